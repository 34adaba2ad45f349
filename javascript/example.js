/** Reads a material, evaluates it, and estimates its albedo by sampling: node example.js gold.smrl */
import { readFile } from "node:fs/promises";
import { load } from "./sommerl.js";

const brdf = await load(await readFile(process.argv[2]));
const wo = [0.6, 0, 0.8];
console.log(`${brdf.info.name}: f_r = ${brdf.eval([0, 0, 1], wo).join(" ")} 1/sr`);
const samples = 20000;
let sum = 0;
for (let i = 0; i < samples; i++) {
    const { weight } = brdf.sample(wo, [Math.random(), Math.random(), Math.random()]); // f_r cos θ_i / pdf
    sum += (weight[0] + weight[1] + weight[2]) / 3;
}
console.log(`albedo = ${sum / samples}`);
