// A lamp as lamp.glb and lamp.obj: a painted globe and a woven ring around it, with seams in their coordinates. In glTF
// they have two sets of them, and the ring's image lies by the second; the sets are 0.4 of each other.
import fs from 'node:fs';
import path from 'node:path';

import {patch, png, turn, write_glb} from './gltf.mjs';

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
    let obj = 'mtllib lamp.mtl\n', mtl = '', first = 1;
    const all = parts.map((part, i) => {
        const others = part.uvs.map(uv => uv.map(x => part.set ? x / 0.4 : 0.4 * x));
        const [uvs, further_uvs] = part.set ? [others, part.uvs] : [part.uvs, others];
        obj += `o ${part.name}\nusemtl ${part.material}\n`;
        for (const [word, values] of [['v', part.positions], ['vn', part.normals],
                                      ['vt', part.uvs.map(([u, v]) => [u, 1 - v])]])
            obj += values.map(value => `${word} ${value.join(' ')}\n`).join('');
        const corner = v => Array(3).fill(first + v).join('/');
        obj += part.triangles.map(triangle => `f ${triangle.map(corner).join(' ')}\n`).join('');
        first += part.positions.length;
        mtl += `newmtl ${part.material}\nKd ${part.colour.join(' ')}\nmap_Kd ${part.image}.png\n`;
        fs.writeFileSync(path.join(folder, part.image + '.png'), images[part.image]);
        return {...part, uvs, further_uvs, material: i};
    });
    const materials = parts.map((part, i) => ({name: part.material, pbrMetallicRoughness: {
        baseColorTexture: {index: i, texCoord: part.set}, baseColorFactor: [...part.colour, 1]}}));
    write_glb(path.join(folder, 'lamp.glb'), all, materials, parts.map(part => images[part.image]));
    fs.writeFileSync(path.join(folder, 'lamp.obj'), obj);
    fs.writeFileSync(path.join(folder, 'lamp.mtl'), mtl);
}
