// The contestants of cpp_header.py: PROGRAM SMRL BSDF PAPER MERL ROUNDS. Prints a line for each round and contestant: name, seconds.
#define POWITACQ_IMPLEMENTATION 1
#include POWITACQ
#include "sommerl.hpp"

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <random>

namespace {

constexpr std::size_t count = 100000;
using Direction = std::array<float, 3>;
using Pow = powitacq_rgb::Vector3f;

/// A raw table of MERL's in single precision, looked up as MERL's published reader does it: the half vector is turned to the normal
/// and the light with it, angles are arccosines, and each channel lies in a plane of its own.
struct Table {
    std::vector<float> planes;
    explicit Table(const char* path) : planes(3 * 1458000) {
        std::ifstream file(path, std::ios::binary);
        file.seekg(12);
        for (std::size_t i = 0; i < planes.size(); ++i) {
            double value;
            file.read(reinterpret_cast<char*>(&value), 8);
            planes[i] = static_cast<float>(value * (i < 1458000 ? 1.0 : i < 2916000 ? 1.15 : 1.66) / 1500.0);
        }
    }
    static int clipped(int bin, int bins) { return bin < 0 ? 0 : bin >= bins ? bins - 1 : bin; }
    Direction eval(const Direction& wi, const Direction& wo) const {
        constexpr float pi = 3.14159265f;
        float hx = wi[0] + wo[0], hy = wi[1] + wo[1], hz = wi[2] + wo[2];
        const float length = std::sqrt(hx * hx + hy * hy + hz * hz);
        hx /= length, hy /= length, hz /= length;
        const float theta_h = std::acos(hz), phi_h = std::atan2(hy, hx);
        const float c = std::cos(-phi_h), s = std::sin(-phi_h), x = c * wi[0] - s * wi[1], y = s * wi[0] + c * wi[1];
        const float ct = std::cos(-theta_h), st = std::sin(-theta_h), dx = ct * x + st * wi[2], dz = ct * wi[2] - st * x;
        const float theta_d = std::acos(dz < 1 ? dz : 1);
        float phi_d = std::atan2(y, dx);
        if (phi_d < 0) phi_d += pi;
        const int i = clipped(theta_h <= 0 ? 0 : static_cast<int>(std::sqrt(theta_h / (pi / 2) * 90 * 90)), 90);
        const int j = clipped(static_cast<int>(theta_d / (pi / 2) * 90), 90), k = clipped(static_cast<int>(phi_d / pi * 180), 180);
        const std::size_t cell = static_cast<std::size_t>(k + 180 * (j + 90 * i));
        return {planes[cell], planes[cell + 1458000], planes[cell + 2916000]};
    }
};

/// Of the processor: others may use it, too.
template <class Run> double seconds(Run run) {
    const std::clock_t start = std::clock();
    run();
    return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
}

std::vector<Direction> directions(unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<float> normal;
    std::vector<Direction> made(count);
    for (Direction& w : made) {
        for (float& x : w) x = normal(random);
        const float length = std::sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
        w = {w[0] / length, w[1] / length, std::fabs(w[2]) / length};
    }
    return made;
}

Pow pow_of(const Direction& w) { return {w[0], w[1], w[2]}; }

}  // namespace

int main(int, char** arguments) {
    const auto compact = sommerl::Brdf::load(arguments[1]), paper = sommerl::Brdf::load(arguments[3]);
    const powitacq_rgb::BRDF measured(arguments[2]);
    const Table table(arguments[4]);
    const auto wi = directions(1), wo = directions(2), u = directions(3);
    float sum = compact.pdf(wi[0], wo[0]);  // fits the sampler
    if (!compact || !paper) return 1;
    const auto tell = [](const char* name, double time) { std::printf("%s\t%.9g\n", name, time); };
    for (int round = std::atoi(arguments[5]); round > 0; --round) {
        tell("eval, sommerl", seconds([&] {
            for (std::size_t i = 0; i < count; ++i) sum += compact.eval(wi[i], wo[i])[1];
        }));
        tell("eval, powitacq", seconds([&] {  // whose wi is where the instrument lights from
            for (std::size_t i = 0; i < count; ++i) sum += measured.eval(pow_of(wo[i]), pow_of(wi[i]))[1];
        }));
        tell("paper, sommerl", seconds([&] {
            for (std::size_t i = 0; i < count; ++i) sum += paper.eval(wi[i], wo[i])[1];
        }));
        tell("paper, table", seconds([&] {
            for (std::size_t i = 0; i < count; ++i) sum += table.eval(wi[i], wo[i])[1];
        }));
        tell("sample, sommerl", seconds([&] {
            Direction drawn;
            float pdf;
            for (std::size_t i = 0; i < count; ++i) {
                const Direction numbers{std::fabs(u[i][0]), std::fabs(u[i][1]), u[i][2]};
                sum += compact.sample(wo[i], numbers, &drawn, &pdf)[1] + compact.pdf(drawn, wo[i]);
            }
        }));
        tell("sample, powitacq", seconds([&] {
            Pow drawn;
            float pdf;
            for (std::size_t i = 0; i < count; ++i) {
                sum += measured.sample({std::fabs(u[i][0]), std::fabs(u[i][1])}, pow_of(wo[i]), &drawn, &pdf)[1];
                if (pdf > 0) sum += measured.pdf(pow_of(wo[i]), drawn);
            }
        }));
        tell("load, sommerl", seconds([&] { sum += sommerl::Brdf::load(arguments[1]) ? 1.0f : 0.0f; }));
        tell("load, powitacq", seconds([&] { powitacq_rgb::BRDF again(arguments[2]); }));
        tell("load and sample, sommerl", seconds([&] { sum += sommerl::Brdf::load(arguments[1]).pdf(wi[0], wo[0]); }));
    }
    std::fprintf(stderr, "%g\n", static_cast<double>(sum));
    return 0;
}
