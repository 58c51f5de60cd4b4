// Pictures by three.js, which Chromium runs.
import {spawn} from 'node:child_process';
import fs from 'node:fs';
import http from 'node:http';
import path from 'node:path';
import {fileURLToPath} from 'node:url';

// Has three.js draw pictures of {file, view} in a folder, into FILE.three.pfm; `has_own`: with materials of its own
// (draw.html). What went wrong, if anything. `packages`: node_modules.
export async function draw_with_three(pictures, folder, packages) {
    const folders = {npm: packages, files: folder, '': path.dirname(fileURLToPath(import.meta.url))};
    const types = {'.html': 'text/html', '.js': 'text/javascript', '.png': 'image/png'};
    let end;
    const ended = new Promise(resolve => { end = resolve; });
    const server = http.createServer(async (request, response) => {
        const [, place, ...names] = decodeURI(request.url).split('/'), chunks = [];
        for await (const chunk of request) chunks.push(chunk);
        if (place === 'pictures') return response.end(JSON.stringify(pictures));
        if (place === 'drawn') fs.writeFileSync(path.join(folder, names + '.three.pfm'), Buffer.concat(chunks));
        if (place === 'end') end(String(Buffer.concat(chunks)));
        const file = place in folders && path.join(folders[place], ...(place ? names : ['draw.html']));
        if (request.method !== 'GET' || !file || !fs.existsSync(file)) return response.writeHead(404).end();
        response.setHeader('Content-Type', types[path.extname(file)] ?? 'application/octet-stream');
        response.end(fs.readFileSync(file));
    });
    await new Promise(resolve => server.listen(0, '127.0.0.1', resolve));
    const browser = spawn('chromium', ['--headless', '--no-sandbox', '--use-angle=swiftshader',
        '--enable-unsafe-swiftshader', `--user-data-dir=${folder}/browser`,
        `http://127.0.0.1:${server.address().port}/`], {stdio: 'ignore'});
    const gone = new Promise(resolve => browser.on('exit', resolve));
    gone.then(status => end('Chromium ended with status ' + status));
    const problem = await ended;
    browser.kill();
    await gone; // it writes to its folder until then
    server.close();
    return problem;
}

// Of a square PFM picture in luminance or linear RGB.
export function luminances(file, size) {
    const bytes = fs.readFileSync(file), channels = bytes.toString('latin1', 0, 2) === 'PF' ? 3 : 1;
    const values = bytes.subarray(-4 * channels * size ** 2), found = new Float32Array(size ** 2);
    for (let pixel = 0; pixel < size ** 2; ++pixel) {
        const value = channel => values.readFloatLE(4 * (channels * pixel + channel));
        found[pixel] = channels === 1 ? value(0) : 0.2126 * value(0) + 0.7152 * value(1) + 0.0722 * value(2);
    }
    return found;
}

export function write_luminances(file, values, size) {
    fs.writeFileSync(file, Buffer.concat([Buffer.from(`Pf\n${size} ${size}\n-1.0\n`), Buffer.from(values.buffer)]));
}
