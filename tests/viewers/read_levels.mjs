// Whether gltf-validator finds no error in NAME*.glb, and three.js the levels that NAME.json tells of, in all forms
// with the same shape. read_levels.mjs NPM_FOLDER NAME
import fs from 'node:fs';
import path from 'node:path';
import {createRequire} from 'node:module';

const [npm, name] = process.argv.slice(2);
const validator = createRequire(path.resolve(npm) + '/')('gltf-validator');
globalThis.self = globalThis; // three.js expects a browser
const three = path.resolve(npm, 'node_modules/three');
const THREE = await import(three + '/build/three.module.js');
const {GLTFLoader} = await import(three + '/examples/jsm/loaders/GLTFLoader.js');
const {MeshoptDecoder} = await import(three + '/examples/jsm/libs/meshopt_decoder.module.js');
console.error = () => {}; // without a browser there are no images

const wrong = [];
const expect = (holds, text) => { if (!holds) wrong.push(text); };

// Positions of all triangles' corners below a node, in the model's frame.
function corners(node) {
    const found = [];
    node.updateMatrixWorld(true);
    node.traverse(part => {
        if (!part.isMesh) return;
        const {index, attributes} = part.geometry;
        for (let i = 0; i < index.count; ++i)
            found.push(new THREE.Vector3().fromBufferAttribute(attributes.position, index.getX(i))
                .applyMatrix4(part.matrixWorld));
    });
    return found;
}

// By level: the first is what stands in the scene, the others are nodes of their own.
async function levels(file) {
    const bytes = fs.readFileSync(file);
    const loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
    const gltf = await loader.parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), '');
    const all = [corners(gltf.scene)];
    for (const node of gltf.parser.json.nodes)
        for (const id of node.extensions?.MSFT_lod?.ids ?? [])
            all.push(corners(await gltf.parser.getDependency('node', id)));
    return all;
}

// The largest distance from a point of `from` to the nearest one of `to`, if it is below `reach`; else infinite.
function farthest(from, to, reach) {
    const cells = new Map(), cell = p => [p.x, p.y, p.z].map(x => Math.floor(x / reach));
    for (const p of to) {
        const key = cell(p).join();
        if (!cells.has(key)) cells.set(key, []);
        cells.get(key).push(p);
    }
    let most = 0;
    for (const p of from) {
        const [x, y, z] = cell(p);
        let nearest = Infinity;
        for (let i = -1; i <= 1; ++i)
            for (let j = -1; j <= 1; ++j)
                for (let k = -1; k <= 1; ++k)
                    for (const q of cells.get([x + i, y + j, z + k].join()) ?? [])
                        nearest = Math.min(nearest, p.distanceTo(q));
        most = Math.max(most, nearest);
    }
    return most;
}

const folder = path.dirname(name), files = fs.readdirSync(folder)
    .filter(file => file.startsWith(path.basename(name)) && file.endsWith('.glb')).map(file => path.join(folder, file));
for (const file of files) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)));
    const errors = report.issues.messages.filter(message => message.severity === 0);
    expect(errors.length === 0, `${file}: ${JSON.stringify(errors.slice(0, 3))}`);
}

const told = JSON.parse(fs.readFileSync(name + '.json')).objects[0].levels.map(level => level.triangles);
expect(told.length >= 3, `only ${told.length} levels`);
const plain = await levels(name + '.glb');
for (const [form, is_rounded] of [['', false], ['-quantized', true], ['-compressed', false], ['-small', true]]) {
    if (!files.includes(name + form + '.glb')) continue;
    const read = form ? await levels(name + form + '.glb') : plain;
    expect(JSON.stringify(read.map(all => all.length / 3)) === JSON.stringify(told),
           `${name}${form}: ${read.map(all => all.length / 3)} triangles, not ${told}`);
    for (let i = 0; i < read.length; ++i) {
        const size = new THREE.Box3().setFromPoints(plain[i]).getSize(new THREE.Vector3());
        const side = Math.max(size.x, size.y, size.z);
        // Half a step of each coordinate, and what floats round; else floats alone.
        const most = is_rounded ? Math.sqrt(3) * side / 65535 / 2 + 1e-6 * side : 1e-6 * side;
        const away = Math.max(farthest(read[i], plain[i], 4 * most), farthest(plain[i], read[i], 4 * most));
        expect(away <= most, `${name}${form}, level ${i}: ${away} away, more than ${most}`);
    }
}
for (let i = 0; i < told.length; ++i) {
    const [alone] = await levels(`${name}_lod${i}.glb`);
    expect(alone.length / 3 === told[i], `${name}_lod${i}: ${alone.length / 3} triangles, not ${told[i]}`);
}

console.log(`${path.basename(name)}: ${files.length} files, levels of ${told.join(', ')} triangles`);
if (wrong.length) console.log(wrong.join('\n'));
process.exit(wrong.length ? 1 : 0);
