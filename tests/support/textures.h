// Textures made by code, and meshes that have them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include <unseen/vdtree/mesh.h>

#include "shapes.h"

namespace unseen::textures {

using vdtree::Mesh;
using vdtree::Texture;

// Fields of `cell` texels of the two codes, grey.
inline Texture checkerboard(std::uint32_t width, std::uint32_t height, std::uint32_t cell, std::uint8_t dark,
                            std::uint8_t bright) {
    Texture texture{width, height, {}, {}, {}};
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) {
            const std::uint8_t code = (x / cell + y / cell) % 2 ? bright : dark;
            texture.texels.push_back({code, code, code, 255});
        }
    return texture;
}

// Independent texels, in all channels from `lo` to `hi`.
inline Texture noise(std::uint32_t width, std::uint32_t height, std::uint64_t seed, double lo = 0, double hi = 255) {
    std::mt19937_64 random(seed);
    Texture texture{width, height, {}, {}, {}};
    const auto code = [&] { return static_cast<std::uint8_t>(shapes::random_between(random, lo, hi)); };
    for (std::uint32_t i = 0; i < width * height; ++i) {
        const std::uint8_t r = code(), g = code(), b = code();
        texture.texels.push_back({r, g, b, 255});
    }
    return texture;
}

// Coordinates by place, whatever the shape.
inline Mesh with_uvs(Mesh mesh, const Texture& texture, double scale = 0.5) {
    mesh.uvs.clear();
    for (const glm::dvec3& p : mesh.positions)
        mesh.uvs.push_back(glm::vec2(glm::dvec2(scale * (p.x + 0.3 * p.z), scale * (p.y - 0.2 * p.z))));
    mesh.texture = texture;
    return mesh;
}

// The flat square of n x n cells with the texture once over it.
inline Mesh textured_grid(int n, const Texture& texture) {
    Mesh mesh = shapes::grid(n);
    glm::dvec3 low = mesh.positions[0], high = low;
    for (const glm::dvec3& p : mesh.positions) low = glm::min(low, p), high = glm::max(high, p);
    for (glm::dvec3& p : mesh.positions) {
        p.z = 0;
        mesh.uvs.push_back(glm::vec2((p.x - low.x) / (high.x - low.x), (p.y - low.y) / (high.y - low.y)));
    }
    mesh.texture = texture;
    return mesh;
}

// Closed; the texture is pressed onto it from both sides, mirrored behind, so that there is no seam.
inline Mesh textured_sphere(int level, const Texture& texture, double scale = 0.5) {
    Mesh mesh = shapes::icosphere(level);
    for (const glm::dvec3& p : mesh.positions)
        mesh.uvs.push_back(glm::vec2(glm::dvec2(0.5 + scale * p.x, 0.5 + scale * p.y)));
    mesh.texture = texture;
    return mesh;
}

// What lies to the right of this place gets its coordinates from elsewhere in the texture, by vertices of its own.
inline Mesh with_seams(const Mesh& mesh, double at = 0) {
    Mesh out = mesh;
    std::vector<vdtree::Index> twin(mesh.positions.size(), vdtree::Index(-1));
    for (vdtree::Triangle& t : out.triangles) {
        const double x = mesh.positions[t[0]].x + mesh.positions[t[1]].x + mesh.positions[t[2]].x;
        if (!(x > 3 * at)) continue;
        for (vdtree::Index& v : t) {
            if (twin[v] == vdtree::Index(-1)) {
                twin[v] = static_cast<vdtree::Index>(out.positions.size());
                out.positions.push_back(mesh.positions[v]);
                out.uvs.push_back(glm::vec2(0.7f - 0.5f * mesh.uvs[v].x, mesh.uvs[v].y + 0.37f));
                if (!mesh.colours.empty()) out.colours.push_back(mesh.colours[v]);
                if (!mesh.normals.empty()) out.normals.push_back(mesh.normals[v]);
            }
            v = twin[v];
        }
    }
    return out;
}

// Every vertex another colour, by chance.
inline Mesh with_colours(Mesh mesh) {
    std::mt19937_64 random(9);
    for (std::size_t v = 0; v < mesh.positions.size(); ++v)
        mesh.colours.push_back(
            {shapes::random_unit(random), shapes::random_unit(random), shapes::random_unit(random), 1});
    return mesh;
}

// Five kinds: smooth, flat, coloured too, with seams, and a soup.
inline Mesh textured_cases(int which) {
    const Texture speckled = noise(61, 40, 5);
    switch (which) {
    case 0: return textured_sphere(4, speckled);
    case 1: return textured_grid(20, checkerboard(32, 32, 4, 20, 230));
    case 2: return with_colours(textured_sphere(3, speckled));
    case 3: return with_seams(textured_sphere(3, speckled));
    default: return with_uvs(shapes::random_soup(200, 400, 3), speckled);
    }
}

} // namespace unseen::textures
