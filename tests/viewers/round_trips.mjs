// Whether simplified glTF and OBJ files hold what their sources do, and look in three.js, which Chromium runs, as in
// Unseen. round_trips.mjs UNSEEN NPM_FOLDER EMPTY_FOLDER MODEL.glb ... Exit status 77: all but the pictures.
import {execFileSync, spawnSync} from 'node:child_process';
import fs from 'node:fs';
import {createRequire} from 'node:module';
import path from 'node:path';
import {isDeepStrictEqual} from 'node:util';

import {write_lamp} from './lamp.mjs';
import {draw_with_three, luminances, write_luminances} from './three.mjs';

const [unseen, npm, folder, ...models] = process.argv.slice(2);
const packages = path.resolve(npm, 'node_modules'), three = packages + '/three';
const validator = createRequire(packages + '/')('gltf-validator');
globalThis.self = globalThis; // three.js expects a browser
const THREE = await import(three + '/build/three.module.js');
const {GLTFLoader} = await import(three + '/examples/jsm/loaders/GLTFLoader.js');
const {OBJLoader} = await import(three + '/examples/jsm/loaders/OBJLoader.js');
console.error = () => {}; // without a browser there are no images

const wrong = [];
const expect = (holds, text) => { if (!holds) wrong.push(text); };
const run = (...words) =>
    execFileSync(unseen, words.map(String), {cwd: folder, encoding: 'utf8', stdio: ['ignore', 'pipe', 'pipe']});
const bytes_of = file => fs.readFileSync(path.join(folder, file));

// What three.js finds in a file. By set: coordinates, corner after corner.
async function contents(file) {
    const bytes = bytes_of(file), found = {file, triangles: 0, parts: {}, sets: {}, box: new THREE.Box3()};
    let scene;
    if (file.endsWith('.obj')) {
        scene = new OBJLoader().parse(bytes.toString());
        found.kept = bytes.toString().match(/^mtllib .*$/gm);
    } else {
        const data = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
        const gltf = await new GLTFLoader().parseAsync(data, ''), json = gltf.parser.json;
        const report = await validator.validateBytes(new Uint8Array(bytes));
        found.problems = report.issues.messages.filter(message => message.severity <= 1) // errors and warnings
            .map(({code, message, pointer}) => `${code} at ${pointer}: ${message}`);
        found.kept = [json.nodes.map(node => node.name), json.materials, json.textures, json.samplers,
                      json.images.map(({name, mimeType}) => [name, mimeType])];
        scene = gltf.scene;
    }
    found.box.setFromObject(scene);
    scene.traverse(part => {
        if (!part.isMesh) return;
        const {index, attributes} = part.geometry, corners = index?.count ?? attributes.position.count;
        found.triangles += corners / 3;
        const names = Object.keys(attributes).sort(), materials = [part.material].flat().map(({name}) => name);
        found.parts[[part.parent.name, part.name, ...materials].join('/')] = names.join();
        for (const set of names.filter(name => name.startsWith('uv')))
            for (let i = 0; i < corners; ++i)
                (found.sets[set] ??= []).push(
                    [0, 1].map(k => attributes[set].getComponent(index ? index.getX(i) : i, k)));
    });
    return found;
}

function expect_what_it_had(source, cut, percent) {
    const here = (holds, text) => expect(holds, `${cut.file}: ${text}`);
    const most = Math.ceil(source.triangles * percent / 100);
    // The lamp's poles are triangles without area, which nothing keeps.
    here(cut.triangles <= most && cut.triangles >= 0.95 * most, `${cut.triangles} triangles, not ${most}`);
    here(isDeepStrictEqual(cut.kept, source.kept), `${JSON.stringify(cut.kept)}, not ${JSON.stringify(source.kept)}`);
    here(!cut.problems?.length, cut.problems?.slice(0, 3).join('\n'));
    for (const [name, attributes] of Object.entries(cut.parts))
        here(attributes === source.parts[name], `${name} has ${attributes}, not ${source.parts[name]}`);
    if (percent === 100) here(isDeepStrictEqual(cut.parts, source.parts), 'parts are missing');
    for (const set in source.sets)
        for (let k = 0; k < 2; ++k) { // coordinates that leave the charts a little are those of a fitted proxy
            const [had, has] = [source, cut].map(({sets}) => {
                const all = sets[set].map(uv => uv[k]).sort((a, b) => a - b);
                return {low: all[0], high: all.at(-1)};
            });
            const room = (percent >= 10 ? 0.02 : 0.03) * (had.high - had.low);
            here(has.low >= had.low - room && has.high <= had.high + room,
                 `${set} from ${has.low} to ${has.high}, not ${had.low} to ${had.high}`);
        }
    if (cut.file !== `lamp-${percent}.glb`) return;
    // The set that is drawn is fitted together with the shape, the other one afterwards, in straight lines.
    const {uv, uv1} = cut.sets, most_apart = percent === 100 ? 1e-6 : percent >= 10 ? 0.04 : 0.06;
    const apart = Math.max(...uv.map((first, i) => Math.max(...first.map((x, k) => Math.abs(uv1[i][k] - 0.4 * x)))));
    here(apart <= most_apart, `its second coordinates are not 0.4 of the first, by ${apart}`);
}

// Where three.js says that a picture is not defined, both become black. How many pixels.
function leave_out(theirs, ours, pixels) {
    const pictures = [theirs, ours].map(bytes_of), values = pictures.map(bytes => bytes.subarray(-4 * pixels));
    let left_out = 0;
    for (let at = 0; at < 4 * pixels; at += 4) {
        if (!Number.isNaN(values[0].readFloatLE(at))) continue;
        ++left_out;
        for (const of of values) of.writeFloatLE(0, at);
    }
    [theirs, ours].forEach((file, i) => fs.writeFileSync(path.join(folder, file), pictures[i]));
    return left_out;
}

function compare(a, b) {
    const {visible_at, max_ratio} = JSON.parse(run('compare', a, b, '--json', '-'));
    expect(visible_at === 0, `${a} and ${b} differ visibly at ${visible_at} pixels, ${max_ratio} times the threshold`);
    return max_ratio.toFixed(2);
}

// With each picture that three.js drew, Unseen's; and what is whole with its source.
function compare_all(pictures) {
    for (const {file, view, whole} of pictures) {
        const [theirs, ours] = [file + '.three.pfm', file + '.unseen.pfm'], pixels = view.size ** 2;
        run('render', file, '--as', 'model', '--full', '--eye', ...view.eye, '--target', ...view.target,
            '--fov', view.fov, '--size', view.size, '--samples', 256, '-o', ours);
        write_luminances(path.join(folder, ours), luminances(path.join(folder, ours), view.size), view.size);
        const left_out = leave_out(theirs, ours, pixels);
        expect(left_out <= 0.02 * pixels, `${file}: three.js left out ${left_out} pixels`);
        const found = [`${compare(theirs, ours)} of the threshold`];
        if (left_out) found.push(`${left_out} pixels left out`);
        if (whole)
            for (const reader of ['three', 'unseen'])
                found.push(compare(`${whole}.${reader}.pfm`, `${file}.${reader}.pfm`) + ' from its source in ' + reader);
        console.log(`${file}: ${found.join(', ')}`);
    }
}

write_lamp(folder);
const sources = ['lamp.glb', 'lamp.obj'], pictures = [];
for (const model of models) {
    sources.push(path.basename(path.dirname(model)) + '.glb');
    fs.copyFileSync(model, path.join(folder, sources.at(-1)));
}
for (const file of sources) {
    const source = await contents(file), {name, ext} = path.parse(file), before = pictures.length;
    const target = source.box.getCenter(new THREE.Vector3()).toArray();
    const size = source.box.getSize(new THREE.Vector3()).length();
    const view = {target, eye: [0.9, 0.7, 1.3].map((x, k) => target[k] + size * x), fov: 24, size: 256};
    pictures.push({file, view});
    for (const percent of [100, 50, 10, 2]) {
        const cut = `${name}-${percent}${ext}`;
        run('simplify', file, '--as', 'model', '--triangles', percent + '%', '--fill-budget', '-o', cut);
        expect_what_it_had(source, await contents(cut), percent);
        if (percent === 100 || percent === 10) pictures.push({file: cut, view, whole: percent === 100 && file});
    }
}

let skipped = spawnSync('chromium', ['--version']).error && 'chromium is not installed';
if (!skipped) {
    const problem = await draw_with_three(pictures, folder, packages);
    expect(!problem, problem);
    try {
        if (!problem) compare_all(pictures);
    } catch (error) {
        if (!String(error.stderr).includes('No OpenGL')) throw error;
        skipped = error.stderr;
    }
}
if (wrong.length) console.log(wrong.join('\n'));
else if (skipped) console.log(`skipped: ${skipped}; all but the pictures is as it should be`);
process.exit(wrong.length ? 1 : skipped ? 77 : 0);
