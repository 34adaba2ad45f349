/**
 * WGSL from GLSL: of that language what the page's fragment shaders use, and no more.
 *
 * They use, beside statements and operators: float, int, uint, bool, vec2 to vec4, ivec2 to ivec4, mat3; structures; arrays of vec4
 * as uniforms; parameters that are out or inout, for which whole variables are given; textures that are read by texelFetch; and built-in
 * functions that WGSL has, whose arguments have one type. Of both values of `? :`, both are calculated.
 */

const TYPES = Object.entries({
    float: "f32", int: "i32", uint: "u32", bool: "bool", vec2: "vec2f", vec3: "vec3f", vec4: "vec4f", ivec2: "vec2i", ivec3: "vec3i", ivec4: "vec4i",
    mat3: "mat3x3f", sampler2D: "texture_2d<f32>", usampler2D: "texture_2d<u32>",
});
const CALLS = new Map([["texelFetch", "textureLoad"], ["inversesqrt", "inverseSqrt"]]);
const LEVELS = ["||", "&&", "|", "^", "&", "== !=", "< > <= >=", "<< >>", "+ -", "* / %"].map((level) => level.split(" ")); // of operators
const TOKEN = /\/\/.*|\s+|(\d[\w.]*(?<=\de)[+-]\d+|\d[\w.]*|\w+|<<|>>|&&|\|\||\+\+|--|[-+*/<>=!]=|[^])/g;

/** The lines that #ifdef and its like leave, for what is given by #define. */
function chosen(source) {
    const defined = new Set();
    const open = []; // of each #if: whether the lines are left, and whether those of a branch before were
    const holds = (one) => defined.has(/\w+(?=\)?$)/.exec(one)[0]) !== one.startsWith("!");
    const any = (condition) => condition.split(" || ").some((all) => all.split(" && ").every(holds));
    const left = () => open.every(([now]) => now);
    const directives = {
        define: (name) => left() && defined.add(name),
        ifdef: (name) => open.push([defined.has(name), false]),
        ifndef: (name) => open.push([!defined.has(name), false]),
        if: (condition) => open.push([any(condition), false]),
        elif: (condition) => directives.else(condition, any(condition)),
        else: (_, now = true) => open.push((([was, before]) => [now && !was && !before, was || before])(open.pop())),
        endif: () => open.pop(),
    };
    return source.split("\n").filter((line) => {
        const found = /^\s*#(\w+) ?(.*)/.exec(line);
        if (found) directives[found[1]](found[2].replace(/\s*\/\/.*/, "").trim());
        return !found && left();
    }).join("\n");
}

/** Reads GLSL once, from its start to its end, and writes WGSL. */
class Translator {
    constructor(source) {
        this.tokens = [...chosen(source).matchAll(TOKEN)].map(([, token]) => token).filter(Boolean);
        this.at = 0;
        this.types = new Map(TYPES);
        this.uniforms = [["vec2", "uUpwards", 1]]; // type, name, how many: the first one tells where a row of the picture is
        this.textures = []; // names and types
        this.outputs = new Map(); // of functions: whether each parameter is out or inout
        this.pointers = new Set(); // such parameters of the function that is read
    }

    get next() {
        return this.tokens[this.at];
    }

    take() {
        return this.tokens[this.at++];
    }

    /** Whether a token comes next; if so, it is taken. */
    took(token) {
        if (this.next !== token) return false;
        this.at++;
        return true;
    }

    expect(token) {
        const found = this.take();
        if (found !== token) throw new Error(`shader: expected ${token}, found ${this.tokens.slice(this.at - 6, this.at + 3).join(" ")}`);
    }

    type() {
        return this.types.get(this.take());
    }

    /** Things between commas, up to a token. */
    list(end, one) {
        const found = [];
        while (!this.took(end)) {
            found.push(one());
            if (this.next !== end) this.expect(",");
        }
        return found;
    }

    all() {
        const parts = [];
        while (this.next) parts.push(this.declaration());
        return parts.join("\n");
    }

    /** Something outside of functions. */
    declaration() {
        if (this.took("uniform")) return this.uniform();
        if (this.took("struct")) return this.struct();
        if (this.took("out")) {
            [this.result] = this.tokens.slice(this.at + 1);
            return this.variables("var<private>");
        }
        if (this.next === "const") return this.variables();
        return this.tokens[this.at + 2] === "(" ? this.function() : this.variables("var<private>");
    }

    uniform() {
        const type = this.take();
        const names = this.list(";", () => {
            const name = this.take();
            const count = this.took("[") ? Number(this.take()) : 1;
            if (count > 1) this.expect("]");
            return [type, name, count];
        });
        const kept = type.endsWith("sampler2D") ? this.textures : this.uniforms;
        kept.push(...names);
        return "";
    }

    struct() {
        const name = this.take();
        this.types.set(name, name);
        this.expect("{");
        const fields = [];
        while (!this.took("}")) {
            const type = this.type();
            fields.push(...this.list(";", () => `${this.take()}: ${type},`));
        }
        this.expect(";");
        return `struct ${name} { ${fields.join(" ")} }`;
    }

    /** A parameter can be assigned to in GLSL, but not in WGSL: of those that are no textures, there is a variable. */
    function() {
        const type = this.type();
        const name = this.take();
        this.expect("(");
        this.pointers = new Set();
        const copies = [];
        const outputs = [];
        const parameters = this.list(")", () => {
            const out = this.took("out") || this.took("inout");
            const [kind, one] = [this.type(), this.take()];
            outputs.push(out);
            if (out) this.pointers.add(one);
            if (out) return `${one}: ptr<function, ${kind}>`;
            if (kind.startsWith("texture")) return `${one}: ${kind}`;
            copies.push(`var ${one} = ${one}_;`);
            return `${one}_: ${kind}`;
        });
        this.outputs.set(name, outputs);
        this.expect("{");
        return `fn ${name}(${parameters.join(", ")})${type ? ` -> ${type}` : ""} {\n${copies.join(" ")}${this.statements()}`;
    }

    statements() {
        const found = [];
        while (!this.took("}")) found.push(this.statement());
        return `${found.join("\n")}\n}`;
    }

    /** One statement, or several in braces; in braces. */
    block() {
        return this.took("{") ? `{\n${this.statements()}` : `{ ${this.statement()} }`;
    }

    statement() {
        if (this.next === "{") return this.block();
        if (this.took("if")) {
            const found = `if ${this.inParentheses()} ${this.block()}`;
            return this.took("else") ? `${found} else ${this.block()}` : found;
        }
        if (this.took("while")) return `while ${this.inParentheses()} ${this.block()}`;
        if (this.took("for")) return this.for();
        if (this.took("return")) return this.took(";") ? "return;" : `return ${this.ended()};`;
        if (this.isType()) return this.variables();
        return `${this.ended(this.assignment())};`;
    }

    isType() {
        return this.next === "const" || (this.types.has(this.next) && /^\w/.test(this.tokens[this.at + 1]));
    }

    for() {
        this.expect("(");
        const first = this.took(";") ? ";" : this.variables();
        const condition = this.next === ";" ? "" : this.expression();
        this.expect(";");
        const then = this.next === ")" ? "" : this.assignment();
        this.expect(")");
        return `for (${first} ${condition}; ${then}) ${this.block()}`;
    }

    /** Whatever needs parentheses is written with some. */
    inParentheses() {
        this.expect("(");
        const found = this.expression();
        this.expect(")");
        return found;
    }

    ended(found = this.expression()) {
        this.expect(";");
        return found;
    }

    variables(how = "var") {
        const kind = this.took("const") ? "const" : how;
        const type = this.type();
        return this.list(";", () => `${kind} ${this.take()}: ${type}${this.took("=") ? ` = ${this.expression()}` : ""};`).join(" ");
    }

    /** An assignment, or a call. */
    assignment() {
        const left = this.expression();
        if (["++", "--"].includes(this.next)) return left + this.take();
        if (!/^[-+*/%&|^]?=$/.test(this.next)) return left;
        return `${left} ${this.take()} ${this.expression()}`;
    }

    expression() {
        const condition = this.binary(0);
        if (!this.took("?")) return condition;
        const yes = this.expression();
        this.expect(":");
        return `select(${this.expression()}, ${yes}, ${condition})`;
    }

    binary(level) {
        if (level === LEVELS.length) return this.unary();
        let found = this.binary(level + 1);
        while (LEVELS[level].includes(this.next)) found = `(${found} ${this.take()} ${this.binary(level + 1)})`;
        return found;
    }

    unary() {
        return this.next === "-" || this.next === "!" ? `(${this.take()}${this.unary()})` : this.postfix();
    }

    postfix() {
        let found = this.next === "(" ? this.inParentheses() : this.word();
        while (true) {
            if (this.took(".")) found += `.${this.take()}`;
            else if (this.took("[")) {
                found += `[${this.expression()}]`;
                this.expect("]");
            } else return found;
        }
    }

    /** A number, a variable, or a call. */
    word() {
        const word = this.take();
        if (this.took("(")) return this.call(word);
        if (this.pointers.has(word)) return `(*${word})`;
        return this.uniforms.some(([, name]) => name === word) ? `given.${word}` : word;
    }

    call(name) {
        const outputs = this.outputs.get(name) ?? [];
        let i = 0;
        const values = this.list(")", () => (outputs[i++] ? "&" : "") + this.expression()).join(", ");
        if (name === "textureSize") return `vec2i(textureDimensions(${values}))`;
        return `${this.types.get(name) ?? CALLS.get(name) ?? name}(${values})`;
    }
}

const UNITS = { 2: 2, 3: 4, 4: 4 }; // of a vector, in numbers: it begins at a multiple

/** Where uniforms are in a buffer: of each by its name, its place in bytes, and which array takes its numbers. */
function placed(uniforms) {
    let size = 0;
    const places = uniforms.map(([type, name, count]) => {
        const length = Number(/\d?$/.exec(type)[0] || 1);
        const at = Math.ceil(size / (UNITS[length] ?? 1)) * (UNITS[length] ?? 1);
        size = at + length * count;
        return { name, at: 4 * at, Numbers: { f: Float32Array, v: Float32Array, i: Int32Array, u: Uint32Array }[type[0]] };
    });
    return { places, size: 16 * Math.ceil(size / 4) };
}

/**
 * {code, places, size, textures}: a module with the entry points `vertex`, which covers the picture, and `fragment`; its uniforms are
 * at binding 0, its textures, {name, sampleType}, at those from 1 on.
 */
export function translated(source) {
    const translator = new Translator(source);
    const body = translator.all();
    const { uniforms, textures, types, result } = translator;
    const typed = ([type, name, count]) => `${name}: ${count > 1 ? `array<${types.get(type)}, ${count}>` : types.get(type)},`;
    const code = [
        `struct Given { ${uniforms.map(typed).join(" ")} }`,
        "@group(0) @binding(0) var<uniform> given: Given;",
        ...textures.map(([type, name], i) => `@group(0) @binding(${i + 1}) var ${name}: ${types.get(type)};`),
        "var<private> gl_FragCoord: vec4f;",
        body,
        "@vertex fn vertex(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {",
        "return vec4f(vec2f(vec2u(i & 1, i >> 1)) * 4 - 1, 0, 1);",
        "}",
        "@fragment fn fragment(@builtin(position) place: vec4f) -> @location(0) vec4f {",
        "gl_FragCoord = vec4f(place.x, given.uUpwards.x + given.uUpwards.y * place.y, place.zw);",
        `main();\nreturn ${result};\n}`,
    ].join("\n");
    const sampled = textures.map(([type, name]) => ({ name, sampleType: type === "usampler2D" ? "uint" : "unfilterable-float" }));
    return { code, textures: sampled, ...placed(uniforms) };
}
