// Whether Unseen draws materials of glTF as three.js does with its own shaders: normal maps, emission, cut-outs, what shows
// through, and unlit surfaces with coordinates of their own. materials.mjs UNSEEN NPM_FOLDER EMPTY_FOLDER. Exit status 77:
// there is no browser, or no OpenGL.
import {execFileSync, spawnSync} from 'node:child_process';
import path from 'node:path';

import {patch, png, turn, write_glb} from './gltf.mjs';
import {draw_with_three, luminances} from './three.mjs';

const [unseen, npm, folder] = process.argv.slice(2);
const most_mean = 0.005; // of white: the difference over what is drawn
const size = 256, black = 0.5, white = 100, background = 20; // pixels, cd/m2

// ---- models

const ball = (radius, spread, z = 0) => patch(48, 24, spread, (u, v) => {
    const [c, s] = turn(u), height = Math.cos(Math.PI * v), width = v % 1 ? Math.sin(Math.PI * v) : 0;
    const normal = [width * s, height, width * c];
    return [normal.map((x, k) => radius * x + (k === 2 ? z : 0)), normal];
});
// A square before the eye, its image's first row at the top.
function square(side, x, y, z, spread = [1, 1]) {
    const corners = [[0, 0], [1, 0], [1, 1], [0, 1]];
    return {positions: corners.map(([u, v]) => [x + side * (u - 0.5), y + side * (0.5 - v), z]),
            normals: corners.map(() => [0, 0, 1]), uvs: corners.map(([u, v]) => [spread[0] * u, spread[1] * v]),
            triangles: [[0, 3, 1], [1, 3, 2]]};
}
const mirrored = part => ({...part, uvs: part.uvs.map(([u, v]) => [1 - u, v])});

// Bumps: the gradient of cos(2 pi n u) cos(2 pi n v).
function bumps(n, steepness) {
    return png(256, (u, v) => {
        const [cu, su] = turn(n * u), [cv, sv] = turn(n * v), x = steepness * su * cv, y = -steepness * cu * sv;
        const length = Math.hypot(x, y, 1);
        return [x, y, 1].map(axis => Math.round(128 + 127 * axis / length));
    });
}
const paint = png(128, (u, v) => [90 + 120 * u, 130 + 80 * turn(3 * u)[1], 220 - 150 * v].map(Math.round));
const dots = png(128, (u, v) => {
    const lit = Math.hypot((4 * u) % 1 - 0.5, (4 * v) % 1 - 0.5) < 0.3;
    return lit ? [255, 200, 60] : [0, 0, 0];
});
const disc = png(128, (u, v) => [230, 250, 120, Math.hypot(u - 0.5, v - 0.5) < 0.42 ? 255 : 0]);
const haze = png(128, (u, v) => [255, 235, 180, Math.round(255 * u)]);
const [first, second] = [{index: 0}, {index: 1}];

const models = {
    relief: {
        parts: [{name: 'ball', material: 0, ...ball(0.7, [2, 1])},
                {name: 'square', material: 1, ...square(0.9, 1.3, 0, 0)},
                {name: 'mirrored', material: 1, ...mirrored(square(0.9, -1.3, 0, 0))}],
        materials: [{pbrMetallicRoughness: {baseColorTexture: first}, normalTexture: {index: 1, scale: 0.7}},
                    {pbrMetallicRoughness: {baseColorFactor: [0.7, 0.6, 0.5, 1]}, normalTexture: second}],
        images: [paint, bumps(4, 0.8)]},
    emission: {
        parts: [{name: 'ball', material: 0, ...ball(0.7, [2, 1])},
                {name: 'lamp', material: 1, ...ball(0.3, [1, 1], 1)}],
        materials: [{pbrMetallicRoughness: {baseColorTexture: first}, emissiveTexture: second, emissiveFactor: [1, 1, 1]},
                    {pbrMetallicRoughness: {baseColorFactor: [0.1, 0.1, 0.1, 1]}, emissiveFactor: [0.2, 0.1, 0],
                     extensions: {KHR_materials_emissive_strength: {emissiveStrength: 3}}}],
        images: [paint, dots]},
    leaves: {
        parts: [0, 1, 2, 3].map(i => ({name: 'leaf ' + i, material: 0, ...square(0.8, i % 2 - 0.4, i / 2 - 0.7, -0.2 * i)})),
        materials: [{pbrMetallicRoughness: {baseColorTexture: first}, alphaMode: 'MASK', doubleSided: true}],
        images: [disc]},
    glass: {
        parts: [{name: 'ball', material: 0, ...ball(0.5, [2, 1])},
                {name: 'haze', material: 1, ...square(1.6, 0, 0, 0.8)}],
        materials: [{pbrMetallicRoughness: {baseColorTexture: first}},
                    {pbrMetallicRoughness: {baseColorTexture: second, baseColorFactor: [1, 1, 1, 0.8]}, alphaMode: 'BLEND'}],
        images: [paint, haze]},
    // By one scale: of two, three.js applies them after the rotation, glTF before.
    unlit: {
        parts: [{name: 'ball', material: 0, ...ball(0.8, [1, 1])}],
        materials: [{pbrMetallicRoughness: {baseColorTexture: {index: 0, extensions: {KHR_texture_transform: {
                         offset: [0.2, 0.1], rotation: 0.5, scale: [3, 3]}}}}, extensions: {KHR_materials_unlit: {}}}],
        images: [paint]},
};

// ---- pictures

const view = {target: [0, 0, 0], eye: [0.8, 0.9, 4.2], fov: 36, size};
const pictures = Object.keys(models).map(name => ({file: name + '.glb', view, has_own: true}));
for (const [name, {parts, materials, images}] of Object.entries(models))
    write_glb(path.join(folder, name + '.glb'), parts, materials, images);

function draw(file, picture) {
    execFileSync(unseen, ['render', file, '--as', 'model', '--full', '--eye', ...view.eye, '--target', ...view.target,
        '--fov', view.fov, '--size', view.size, '--samples', 256, '-o', picture].map(String),
        {cwd: folder, stdio: ['ignore', 'pipe', 'pipe']});
}

function difference(theirs, ours) {
    let sum = 0, drawn = 0, most = 0;
    theirs.forEach((y, i) => {
        if (Math.abs(y - background) < 1e-3 && Math.abs(ours[i] - background) < 1e-3) return;
        const apart = Math.abs(y - ours[i]) / (white - black);
        sum += apart, ++drawn, most = Math.max(most, apart);
    });
    return {mean: sum / drawn, drawn, most};
}

if (spawnSync('chromium', ['--version']).error) {
    console.log('skipped: chromium is not installed');
    process.exit(77);
}
let status = 0;
const problem = await draw_with_three(pictures, folder, path.resolve(npm, 'node_modules'));
if (problem) console.log(problem), status = 1;
for (const {file} of problem ? [] : pictures) {
    const ours = file + '.unseen.pfm';
    try {
        draw(file, ours);
    } catch (error) {
        console.log(String(error.stderr));
        process.exit(String(error.stderr).includes('No OpenGL') ? 77 : 1);
    }
    const [theirs, own] = [file + '.three.pfm', ours].map(name => luminances(path.join(folder, name), size));
    const {mean, drawn, most} = difference(theirs, own);
    console.log(`${file}: ${(100 * mean).toFixed(2)}% of white apart in the mean of ${drawn} pixels, ` +
                `${(100 * most).toFixed(0)}% at most`);
    if (!(mean < most_mean && drawn > 0.05 * size ** 2)) status = 1;
}
process.exit(status);
