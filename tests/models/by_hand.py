"""The families' formulas once more, as they are printed: from vectors, and from angles by arccosine."""

import numpy as np


def dot(a, b):
    return (a * b).sum(axis=-1)


def half(wi, wo):
    return (wi + wo) / np.linalg.norm(wi + wo, axis=-1, keepdims=True)


def angle_to_normal(w):
    return np.arccos(w[:, 2])


def schlick(h, w, f0):
    return f0 + (1 - f0) * (1 - dot(h, w)) ** 5


def v_grooves(wi, wo):
    """Blinn's G: light is either blocked on its way in, or on its way out, or not at all."""
    h = half(wi, wo)
    masked = 2 * h[:, 2] * wo[:, 2] / dot(wo, h)
    shadowed = 2 * h[:, 2] * wi[:, 2] / dot(wo, h)
    return np.minimum.reduce([np.ones(len(h)), masked, shadowed])


def lambertian(wi, wo):
    return np.full(len(wi), 1 / np.pi)


def oren_nayar(wi, wo, sigma):
    theta_i, theta_o = angle_to_normal(wi), angle_to_normal(wo)
    phi_i, phi_o = (np.arctan2(w[:, 1], w[:, 0]) for w in (wi, wo))
    alpha, beta = np.maximum(theta_i, theta_o), np.minimum(theta_i, theta_o)
    a = 1 - 0.5 * sigma**2 / (sigma**2 + 0.33)
    b = 0.45 * sigma**2 / (sigma**2 + 0.09)
    return (a + b * np.maximum(0, np.cos(phi_i - phi_o)) * np.sin(alpha) * np.tan(beta)) / np.pi


def phong(wi, wo, n):
    normal = np.array([0, 0, 1])
    mirrored = 2 * dot(normal, wo)[:, None] * normal - wo
    return (n + 2) / (2 * np.pi) * np.maximum(0, dot(mirrored, wi)) ** n


def blinn_phong(wi, wo, n):
    return (n + 2) * (n + 4) / (8 * np.pi * (2 ** (-n / 2) + n)) * half(wi, wo)[:, 2] ** n


def ward(wi, wo, alpha):
    """Ward's Eq. 4, with δ by arccosine."""
    delta = angle_to_normal(half(wi, wo))
    lobe = np.exp(-(np.tan(delta) ** 2) / alpha**2) / (4 * np.pi * alpha**2)
    return lobe / np.sqrt(wi[:, 2] * wo[:, 2])


def ward_duer(wi, wo, alpha):
    """As Walter 2005, "Notes on the Ward BRDF", writes it: with a half vector of any length, and no angle."""
    h = wi + wo
    lobe = np.exp(-((h[:, 0] / alpha) ** 2 + (h[:, 1] / alpha) ** 2) / h[:, 2] ** 2)
    return lobe / (4 * np.pi * alpha**2 * wi[:, 2] * wo[:, 2])


def lafortune(wi, wo, c_xy, n):
    """Lafortune's Eq. 6, with the constants divided by the larger of the two."""
    c = np.array([c_xy, c_xy, 1]) / max(abs(c_xy), 1)
    return (n + 2) / (2 * np.pi) * np.maximum(0, dot(c * wo, wi)) ** n


def cook_torrance(wi, wo, m, f0):
    h = half(wi, wo)
    alpha = angle_to_normal(h)
    d = np.exp(-((np.tan(alpha) / m) ** 2)) / (np.pi * m**2 * np.cos(alpha) ** 4)
    return d * schlick(h, wo, f0) * v_grooves(wi, wo) / (4 * wi[:, 2] * wo[:, 2])


def torrance_sparrow(wi, wo, m, f0):
    h = half(wi, wo)
    d = np.exp(-((angle_to_normal(h) / m) ** 2)) / (np.pi * m**2)
    return d * schlick(h, wo, f0) * v_grooves(wi, wo) / (4 * wi[:, 2] * wo[:, 2])


def ashikhmin_shirley(wi, wo, n, f0):
    """Eq. 4, with the exponent n_u cos² φ + n_v sin² φ for n_u = n_v."""
    h = half(wi, wo)
    factor = np.sqrt((n + 1) * (n + 1)) / (8 * np.pi)
    larger = np.maximum(wi[:, 2], wo[:, 2])
    return factor * h[:, 2] ** n / (dot(h, wi) * larger) * schlick(h, wi, f0)


def ggx(wi, wo, alpha, f0):
    """Walter's D from tangents, Heitz's Λ."""
    h = half(wi, wo)
    tan2_h = 1 / h[:, 2] ** 2 - 1
    d = alpha**2 / (np.pi * h[:, 2] ** 4 * (alpha**2 + tan2_h) ** 2)
    lambdas = [(np.sqrt(1 + alpha**2 * (1 / w[:, 2] ** 2 - 1)) - 1) / 2 for w in (wi, wo)]
    return d * schlick(h, wo, f0) / (1 + lambdas[0] + lambdas[1]) / (4 * wi[:, 2] * wo[:, 2])


def retro_ggx(wi, wo, alpha, f0):
    """By the back vector: the light is mirrored, in place of the viewer, which is the same by symmetry."""
    return ggx(wi * np.array([-1, -1, 1]), wo, alpha, f0)
