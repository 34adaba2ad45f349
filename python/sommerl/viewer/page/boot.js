/** Unpacks the page's script and its worker's. The page's policy names the digests of this script and of the unpacked one, and allows no other. */
async function unpacked(id) {
    const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
    return JSON.parse(await new Response(stream).text());
}

unpacked("packed").then(({ head, parts, script, worker }) => {
    for (const [type, id, names] of [["text/plain", "worker", worker], ["module", "script", script]]) {
        const made = document.createElement("script");
        Object.assign(made, { type, id, textContent: head + names.map((name) => parts[name]).join("") });
        document.body.append(made);
    }
});
