/** A contact sheet: its cards, in an order that is chosen, and the viewer's page for one of them. Text is always text, never markup. */
"use strict";
(() => {
    const ORDERS = [
        ["name", "name", (one) => [one.label]],
        ["size", "size", (one) => [one.bytes]],
        ["quality", "quality", (one) => [one.quality ?? Infinity]],
        ["colour", "colour", (one) => one.hue],
        ["gloss", "gloss", (one) => [one.gloss]],
        ["metalness", "metalness", (one) => [one.metalness]],
    ];
    const KEPT = 60000; // ms, the address of a page that was opened
    const STEP = 120; // cards that are made at a time
    const SVG = "http://www.w3.org/2000/svg";
    const element = (id) => document.getElementById(id);
    const materials = JSON.parse(element("materials").textContent);
    const cards = new Map(); // by material, once they have been needed
    const state = { sort: "name", reverse: false };

    function make(tag, properties, ...children) {
        const made = Object.assign(document.createElement(tag), properties);
        made.append(...children);
        return made;
    }

    function sizeOf(bytes) {
        return bytes < 10000 ? `${bytes.toLocaleString("en")} B` : `${(bytes / 1000).toFixed(bytes < 99950 ? 1 : 0)} kB`;
    }

    /** A disc of a colour: the page's policy allows no styles on elements. */
    function disc(colour) {
        const made = document.createElementNS(SVG, "svg");
        const circle = document.createElementNS(SVG, "circle");
        for (const [name, value] of Object.entries({ cx: 4, cy: 4, r: 4, fill: colour })) circle.setAttribute(name, value);
        made.setAttribute("viewBox", "0 0 8 8");
        made.setAttribute("aria-hidden", "true");
        made.append(circle);
        return made;
    }

    function card(one) {
        const picture = make("img", { src: `data:image/webp;base64,${one.picture}`, alt: "", loading: "lazy", decoding: "async" });
        const quality = one.quality === null ? [] : [make("span", { title: "PSNR in soft light, against the source" }, `${one.quality.toFixed(1)} dB`)];
        const facts = make(
            "span",
            { className: "facts" },
            disc(one.colour),
            make("span", {}, sizeOf(one.bytes)),
            ...quality,
            make("span", { title: "0 is matte, 1 a mirror" }, `gloss ${one.gloss.toFixed(2)}`),
        );
        const about = { type: "button", className: "card", title: `${one.label}: open in the viewer`, onclick: () => open(one) };
        const at = one.label.lastIndexOf("/") + 1;
        const folder = at ? [make("span", { className: "folder" }, one.label.slice(0, at - 1))] : [];
        const name = make("span", { className: "name" }, one.label.slice(at));
        return make("button", about, make("span", { className: "backdrop" }, picture), ...folder, name, facts);
    }

    function compare(a, b) {
        const key = ORDERS.find(([name]) => name === state.sort)[2];
        const [x, y] = [key(a), key(b)];
        for (let i = 0; i < x.length; i++) {
            if (x[i] < y[i]) return -1;
            if (x[i] > y[i]) return 1;
        }
        return a.label < b.label ? -1 : 1;
    }

    let turn = 0;

    /** Shows the cards that are wanted, some at a time, so that the first ones are there at once. */
    function show() {
        const words = element("search").value.toLowerCase().split(/\s+/).filter(Boolean);
        const [gloss, metalness] = ["gloss", "metalness"].map((id) => +element(id).value);
        const wanted = materials.filter(
            (one) => words.every((word) => one.label.toLowerCase().includes(word)) && one.gloss >= gloss && one.metalness >= metalness,
        );
        wanted.sort(compare);
        if (state.reverse) wanted.reverse();
        const all = wanted.length === materials.length;
        element("count").textContent = `${all ? "" : `${wanted.length} of `}${materials.length} materials`;
        const present = ++turn;
        const add = (from) => {
            if (present !== turn) return;
            const some = wanted.slice(from, from + STEP).map((one) => {
                if (!cards.has(one)) cards.set(one, card(one));
                return cards.get(one);
            });
            if (from === 0) element("sheet").replaceChildren(...(wanted.length ? some : [make("p", { id: "none" }, "No material is like that.")]));
            else element("sheet").append(...some);
            if (from + STEP < wanted.length) setTimeout(() => add(from + STEP));
        };
        add(0);
    }

    let template = null;

    async function viewer() {
        const bytes = Uint8Array.from(atob(element("viewer").textContent), (c) => c.charCodeAt(0));
        const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
        return new Response(stream).text();
    }

    /** The viewer's page with one material, in a new tab. */
    async function open(one) {
        const tab = window.open("", "_blank"); // now, while the click allows it
        try {
            template ??= viewer();
            const { name, label, bytes, data } = one;
            const material = { name, label, group: label, step: "reference", command: "", note: "", format: "smrl", deflated: false, bytes, data };
            const values = { materials: JSON.stringify([material]).replaceAll("<", "\\u003c"), title: new Option(label).innerHTML };
            const page = (await template).replace(/@(title|materials)@/g, (_, key) => values[key]);
            const address = URL.createObjectURL(new Blob([page], { type: "text/html" }));
            if (!tab) throw new Error("the browser opened no new tab");
            tab.location = address;
            setTimeout(() => URL.revokeObjectURL(address), KEPT);
        } catch (error) {
            tab?.close();
            element("messages").replaceChildren(make("p", {}, `${one.label}: ${error.message}`));
        }
    }

    element("sort").append(...ORDERS.map(([value, text]) => new Option(text, value)));
    element("sort").onchange = () => {
        state.sort = element("sort").value;
        show();
    };
    element("reverse").onclick = () => {
        state.reverse = !state.reverse;
        element("reverse").setAttribute("aria-pressed", state.reverse);
        element("reverse").textContent = state.reverse ? "↑" : "↓";
        show();
    };
    for (const id of ["search", "gloss", "metalness"]) element(id).oninput = show;
    element("controls").onsubmit = (event) => event.preventDefault();
    show();
    window.sommerl = { first: 1, materials };
})();
