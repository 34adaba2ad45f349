/** What tests ask of the page, and whoever is curious: methods of `sommerl` in the browser's console. */
import { SCENES } from "./camera.js";
import { evaluatedOnGpu } from "./probe.js";

export function hooks({ picture, store, background, state, open }) {
    const { device, renderer } = picture;
    return {
        /** f_r of the shader at pairs of directions, three numbers each, or what else probe.js gives. */
        async evaluate(number, wi, wo, what = "brdf") {
            const material = await store.material(number);
            const table = what === "sample" || what === "pdf" ? (await background.ask({ do: "sampler", material })).table : null;
            return [...(await evaluatedOnGpu(device, material, Float32Array.from(wi), Float32Array.from(wo), what, table))];
        },

        /** Radiance and coverage, in fours from the lowest row, of a picture of its own: the mean of so many paths a pixel. */
        async radiance(number, values, width, height, paths, bounces = 1) {
            const view = { ...state, ...values };
            await store.material(number);
            if (SCENES[view.scene].mesh) await store.mesh(view.scene);
            if (view.environment) await store.environment();
            if (!renderer.isPlain(view, bounces)) await store.sampler(number);
            const film = renderer.film(width, height);
            for (let i = 0; i < paths; i++) renderer.trace(film, store.prepared.get(number), view, bounces);
            const found = [...(await device.pixels(film.mean))];
            renderer.free(film);
            return found;
        },

        /** The same of A as it is on the canvas. */
        onCanvas: async () => [...(await device.pixels(picture.films[0].mean))],

        /** As if a file had been dropped. */
        dropped: (name, base64) => open([new File([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))], name)]),
    };
}
