/** Mouse, touch and keyboard on the picture. */

const [TURN, STEP] = [0.4, 5]; // degrees for a pixel that is dragged, and for a key
const CLICK = 3; // pixels that a click may move

/** What arrow keys turn or move, [dx, dy]. */
export const ARROWS = { ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, -STEP], ArrowDown: [0, STEP] };

/**
 * calls: {turn(dx, dy), light(dx, dy), zoom(factor), point(x, y), key(name) → whether it was one}; dx, dy are in degrees, x and y in the
 * canvas from 0 to 1, or null where the pointer has left. dragsLight(): whether dragging turns the light.
 */
export function listen(canvas, calls, dragsLight) {
    const pointers = new Map();
    let last = null; // of two fingers: their distance
    const place = ({ clientX, clientY }) => {
        const box = canvas.getBoundingClientRect();
        return [(clientX - box.left) / box.width, (clientY - box.top) / box.height];
    };
    canvas.onpointerdown = (event) => {
        pointers.set(event.pointerId, [event.clientX, event.clientY]);
        canvas.setPointerCapture(event.pointerId);
        last = null;
    };
    canvas.onpointermove = (event) => {
        calls.point(...place(event));
        const before = pointers.get(event.pointerId);
        if (!before) return;
        const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
        pointers.set(event.pointerId, [event.clientX, event.clientY]);
        if (pointers.size === 1) {
            const turn = dragsLight() !== (event.shiftKey || event.buttons === 2) ? calls.light : calls.turn;
            turn(dx * TURN, dy * TURN);
        } else if (pointers.size === 2) {
            const [a, b] = [...pointers.values()];
            const distance = Math.hypot(a[0] - b[0], a[1] - b[1]);
            if (last && distance > CLICK) calls.zoom(distance / last);
            last = distance;
        }
    };
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
    canvas.onpointerleave = () => calls.point(null, null);
    canvas.oncontextmenu = (event) => event.preventDefault();
    canvas.addEventListener(
        "wheel",
        (event) => {
            // Elsewhere, and before it is clicked at, the wheel moves the page.
            if (document.activeElement !== canvas && !event.ctrlKey) return;
            event.preventDefault();
            calls.zoom(Math.exp(-0.0015 * event.deltaY));
        },
        { passive: false },
    );
    canvas.onkeydown = (event) => {
        if (event.ctrlKey || event.metaKey || event.altKey) return;
        const arrow = ARROWS[event.key];
        if (arrow) (event.shiftKey ? calls.light : calls.turn)(...arrow);
        if (arrow || calls.key(event.key)) event.preventDefault();
    };
}

/** Lets something be dragged over the picture: move(x, y) is told places from 0 to 1; step(dx, dy), arrow keys. */
export function draggable(handle, canvas, move, step) {
    handle.onkeydown = (event) => {
        if (!ARROWS[event.key]) return;
        event.preventDefault();
        step(...ARROWS[event.key]);
    };
    handle.onpointerdown = (event) => {
        handle.setPointerCapture(event.pointerId);
        event.preventDefault();
        handle.focus();
    };
    handle.onpointermove = (event) => {
        if (!handle.hasPointerCapture(event.pointerId)) return;
        const box = canvas.getBoundingClientRect();
        move((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
    };
}
