/** What readers of files have in common. */

/** Throws an Error of one sentence unless all is fine. */
export function expect(fine, message) {
    if (!fine) throw new Error(message);
}

export function viewOf(bytes) {
    return new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
}

/** Bytes as text, one character each. */
export function latin(bytes) {
    return new TextDecoder("latin1").decode(bytes);
}

/** A number of half precision, of its bits. */
export function half(bits) {
    const [exponent, rest] = [(bits >> 10) & 31, bits & 1023];
    const size = exponent === 31 ? (rest ? NaN : Infinity) : exponent ? (1 + rest / 1024) * 2 ** (exponent - 15) : rest * 2 ** -24;
    return bits >> 15 ? -size : size;
}

/** Decompressed bytes, `most` at most. Throws an Error if there are more, or if the stream is damaged. */
export async function inflated(bytes, kind, most) {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream(kind)).getReader();
    const chunks = [];
    let size = 0;
    for (;;) {
        const { done, value } = await stream.read().catch(() => {
            throw new Error("expected a deflated stream, found one that is damaged or cut off");
        });
        if (done) break;
        size += value.length;
        if (size > most) {
            await stream.cancel();
            throw new Error(`expected at most ${most} bytes, deflated, found more`);
        }
        chunks.push(value);
    }
    const whole = new Uint8Array(size);
    let at = 0;
    for (const chunk of chunks) {
        whole.set(chunk, at);
        at += chunk.length;
    }
    return whole;
}
