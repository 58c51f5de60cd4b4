// Grids, images and GLB files of them.
import fs from 'node:fs';
import zlib from 'node:zlib';

// A picture of so many texels a side; `at(u, v)` gives three codes, or four with alpha.
export function png(side, at) {
    const channels = at(0, 0).length, length = 1 + channels * side, rows = Buffer.alloc(side * length);
    for (let y = 0; y < side; ++y)
        for (let x = 0; x < side; ++x) rows.set(at(x / side, y / side), y * length + 1 + channels * x);
    const chunk = (type, data) => {
        const body = Buffer.concat([Buffer.from(type), data]), all = Buffer.alloc(8 + body.length);
        let crc = -1;
        for (const byte of body) {
            crc ^= byte;
            for (let bit = 0; bit < 8; ++bit) crc = (crc >>> 1) ^ (crc & 1 ? 0xedb88320 : 0);
        }
        all.writeUInt32BE(data.length), body.copy(all, 4), all.writeInt32BE(~crc, 4 + body.length);
        return all;
    };
    const header = Buffer.from([0, 0, 0, 0, 0, 0, 0, 0, 8, channels === 4 ? 6 : 2, 0, 0, 0]); // 8 bits, RGB or RGBA
    header.writeUInt32BE(side), header.writeUInt32BE(side, 4);
    return Buffer.concat([Buffer.from('\x89PNG\r\n\x1a\n', 'latin1'), chunk('IHDR', header),
                          chunk('IDAT', zlib.deflateSync(rows)), chunk('IEND', Buffer.alloc(0))]);
}

// A grid over 0..1 x 0..1; `at(u, v)` gives a position and a normal. v points down, as in glTF.
export function patch(columns, rows, spread, at) {
    const made = {positions: [], normals: [], uvs: [], triangles: []};
    for (let row = 0; row <= rows; ++row)
        for (let column = 0; column <= columns; ++column) {
            const [position, normal] = at(column % columns / columns, row / rows); // the seam's sides are at one place
            made.positions.push(position), made.normals.push(normal);
            made.uvs.push([spread[0] * column / columns, spread[1] * row / rows]);
            if (row === rows || column === columns) continue;
            const first = row * (columns + 1) + column, below = first + columns + 1;
            made.triangles.push([first, below, first + 1], [first + 1, below, below + 1]);
        }
    return made;
}

export const turn = x => [Math.cos(2 * Math.PI * x), Math.sin(2 * Math.PI * x)];

// `parts`: {name, positions, normals, uvs, further_uvs, triangles, material}, by the materials' numbers; `images`: PNG.
export function write_glb(file, parts, materials, images) {
    const document = {
        asset: {version: '2.0'}, scene: 0, scenes: [{nodes: parts.map((part, i) => i)}], nodes: [], meshes: [], materials,
        textures: [], images: [], accessors: [], bufferViews: [], buffers: []};
    const extensions = new Set(JSON.stringify(materials).match(/KHR_\w+/g));
    if (extensions.size) document.extensionsUsed = [...extensions];
    let data = Buffer.alloc(0);
    const add_view = bytes => {
        document.bufferViews.push({buffer: 0, byteOffset: data.length, byteLength: bytes.length});
        data = Buffer.concat([data, bytes, Buffer.alloc(-bytes.length & 3)]);
        return document.bufferViews.length - 1;
    };
    const add_accessor = (array, componentType, values) => {
        const type = values[0].length === undefined ? 'SCALAR' : 'VEC' + values[0].length, all = values.flat();
        const bufferView = add_view(Buffer.from(array.from(all).buffer)), count = values.length;
        const made = {bufferView, componentType, count, type};
        if (type === 'VEC3')
            for (const [bound, best] of [['min', Math.min], ['max', Math.max]])
                made[bound] = [0, 1, 2].map(k => Math.fround(best(...values.map(value => value[k]))));
        document.accessors.push(made);
        return document.accessors.length - 1;
    };
    parts.forEach((part, i) => {
        const attributes = {};
        const arrays = {POSITION: part.positions, NORMAL: part.normals, TEXCOORD_0: part.uvs, TEXCOORD_1: part.further_uvs};
        for (const [name, values] of Object.entries(arrays))
            if (values) attributes[name] = add_accessor(Float32Array, 5126, values);
        const indices = add_accessor(Uint16Array, 5123, part.triangles.flat());
        document.meshes.push({primitives: [{attributes, indices, material: part.material}]});
        document.nodes.push({name: part.name, mesh: i});
    });
    images.forEach((image, i) => {
        document.images.push({bufferView: add_view(image), mimeType: 'image/png'});
        document.textures.push({source: i});
    });
    document.buffers.push({byteLength: data.length});
    let json = Buffer.from(JSON.stringify(document));
    json = Buffer.concat([json, Buffer.alloc(-json.length & 3, ' ')]);
    const words = (...values) => Buffer.from(Uint32Array.from(values).buffer);
    const length = 28 + json.length + data.length;
    fs.writeFileSync(file, Buffer.concat([
        words(0x46546c67, 2, length, json.length, 0x4e4f534a), json, words(data.length, 0x004e4942), data]));
}
