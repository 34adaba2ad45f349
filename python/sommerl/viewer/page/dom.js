/** Elements of the page. Text is always text, never markup. */

/** make("button", { type: "button", onclick }, "Open", child…): an element; texts and elements as children. */
export function make(tag, properties = {}, ...children) {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(properties)) {
        if (name in made) made[name] = value;
        else made.setAttribute(name, value);
    }
    made.append(...children);
    return made;
}

/** A row with a label before its control. */
export function labelled(text, control, ...more) {
    return make("label", { className: "row" }, make("span", {}, text), control, ...more);
}

/** A list to choose from. options: [[value, label]…]. */
export function chooser(options, value, onchange) {
    const made = make("select", { onchange: () => onchange(made.value) });
    refill(made, options, value);
    return made;
}

export function refill(select, options, value) {
    select.replaceChildren(...options.map(([one, text]) => make("option", { value: one }, text)));
    select.value = value;
}

/** Buttons of which one is pressed. options: [[value, label, explanation]…]. */
export function switches(name, options, value, onchange) {
    const made = make("div", { className: "switches", role: "radiogroup", ariaLabel: name });
    for (const [one, text, title = ""] of options) {
        const input = make("input", { type: "radio", name, value: one, checked: one === value, onchange: () => onchange(one) });
        made.append(make("label", { title }, input, make("span", {}, text)));
    }
    return made;
}

/** A slider that says its value. */
export function slider({ min, max, step, value }, say, oninput) {
    const said = make("output", {}, say(value));
    const input = make("input", { type: "range", min, max, step, value });
    input.oninput = () => {
        said.textContent = say(+input.value);
        input.setAttribute("aria-valuetext", said.textContent);
        oninput(+input.value);
    };
    input.setAttribute("aria-valuetext", said.textContent);
    const show = (now) => {
        input.value = now;
        said.textContent = say(now);
        input.setAttribute("aria-valuetext", said.textContent);
    };
    return { input, said, show };
}
