// A lamp as lamp.glb and lamp.obj: a painted globe and a woven ring around it, with seams in their coordinates. In glTF
// they have two sets of them, and the ring's image lies by the second; the sets are 0.4 of each other.
import fs from 'node:fs';
import path from 'node:path';
import zlib from 'node:zlib';

// A picture of so many texels a side; `at(u, v)` gives three codes.
function png(side, at) {
    const rows = Buffer.alloc(side * (1 + 3 * side));
    for (let y = 0; y < side; ++y)
        for (let x = 0; x < side; ++x) rows.set(at(x / side, y / side), y * (1 + 3 * side) + 1 + 3 * x);
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
    const header = Buffer.from([0, 0, 0, 0, 0, 0, 0, 0, 8, 2, 0, 0, 0]); // 8 bits, RGB
    header.writeUInt32BE(side), header.writeUInt32BE(side, 4);
    return Buffer.concat([Buffer.from('\x89PNG\r\n\x1a\n', 'latin1'), chunk('IHDR', header),
                          chunk('IDAT', zlib.deflateSync(rows)), chunk('IEND', Buffer.alloc(0))]);
}

// A grid over 0..1 x 0..1; `at(u, v)` gives a position and a normal. v points down, as in glTF.
function patch(columns, rows, spread, at) {
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

const turn = x => [Math.cos(2 * Math.PI * x), Math.sin(2 * Math.PI * x)];
const parts = [
    {name: 'Globe', material: 'Painted', image: 'painted', colour: [1, 1, 1], set: 0,
     ...patch(96, 48, [1, 1], (u, v) => {
         const [c, s] = turn(u), height = Math.cos(Math.PI * v), width = v % 1 ? Math.sin(Math.PI * v) : 0;
         const normal = [width * s, height, width * c];
         return [normal.map(x => 0.7 * x), normal];
     })},
    {name: 'Ring', material: 'Woven', image: 'woven', colour: [0.9, 0.75, 0.5], set: 1,
     ...patch(128, 32, [8, 2], (u, v) => {
         const [c, s] = turn(u), [out, up] = turn(-(v % 1)), normal = [out * s, up, out * c];
         return [[(1 + 0.2 * out) * s, 0.2 * up, (1 + 0.2 * out) * c], normal];
     })}];
const images = {
    painted: png(256, (u, v) => [60 + 120 * u, 120 + 100 * turn(4 * u)[1] * turn(2 * v)[1], 200 * v]),
    woven: png(64, (u, v) => [140 + 90 * turn(u)[1], 130 + 60 * turn(v)[1], 90])};

export function write_lamp(folder) {
    const document = {
        asset: {version: '2.0'}, scene: 0, scenes: [{nodes: [0, 1]}], nodes: [], meshes: [], materials: [],
        textures: [], images: [], accessors: [], bufferViews: [], buffers: []};
    let data = Buffer.alloc(0), obj = 'mtllib lamp.mtl\n', mtl = '', first = 1;
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
        const others = part.uvs.map(uv => uv.map(x => part.set ? x / 0.4 : 0.4 * x));
        const sets = part.set ? [others, part.uvs] : [part.uvs, others];
        const [POSITION, NORMAL, TEXCOORD_0, TEXCOORD_1] =
            [part.positions, part.normals, ...sets].map(values => add_accessor(Float32Array, 5126, values));
        const indices = add_accessor(Uint16Array, 5123, part.triangles.flat());
        const attributes = {POSITION, NORMAL, TEXCOORD_0, TEXCOORD_1};
        document.meshes.push({primitives: [{attributes, indices, material: i}]});
        document.nodes.push({name: part.name, mesh: i});
        document.images.push({bufferView: add_view(images[part.image]), mimeType: 'image/png'});
        document.textures.push({source: i});
        document.materials.push({name: part.material, pbrMetallicRoughness: {
            baseColorTexture: {index: i, texCoord: part.set}, baseColorFactor: [...part.colour, 1]}});

        obj += `o ${part.name}\nusemtl ${part.material}\n`;
        for (const [word, values] of [['v', part.positions], ['vn', part.normals],
                                      ['vt', part.uvs.map(([u, v]) => [u, 1 - v])]])
            obj += values.map(value => `${word} ${value.join(' ')}\n`).join('');
        const corner = v => Array(3).fill(first + v).join('/');
        obj += part.triangles.map(triangle => `f ${triangle.map(corner).join(' ')}\n`).join('');
        first += part.positions.length;
        mtl += `newmtl ${part.material}\nKd ${part.colour.join(' ')}\nmap_Kd ${part.image}.png\n`;
        fs.writeFileSync(path.join(folder, part.image + '.png'), images[part.image]);
    });
    document.buffers.push({byteLength: data.length});
    let json = Buffer.from(JSON.stringify(document));
    json = Buffer.concat([json, Buffer.alloc(-json.length & 3, ' ')]);
    const words = (...values) => Buffer.from(Uint32Array.from(values).buffer);
    const length = 28 + json.length + data.length;
    fs.writeFileSync(path.join(folder, 'lamp.glb'), Buffer.concat([
        words(0x46546c67, 2, length, json.length, 0x4e4f534a), json, words(data.length, 0x004e4942), data]));
    fs.writeFileSync(path.join(folder, 'lamp.obj'), obj);
    fs.writeFileSync(path.join(folder, 'lamp.mtl'), mtl);
}
