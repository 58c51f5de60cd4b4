#include "textures.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

#include "texture_atlas.h"
#include "texture_image.h"

namespace unseen::session {
namespace {

using meshio::Material;
using vdtree::Index;
using vdtree::Mesh;
using vdtree::MeshRange;
using vdtree::Texture;

// What one can do about a bad image, in the same sentence.
std::string with_advice(std::string complaint) {
    if (complaint.ends_with('.')) complaint.pop_back();
    return complaint + " (load.texture names another image, load.without_textures leaves images out).";
}

constexpr std::size_t no_material = std::numeric_limits<std::size_t>::max(), unused = no_material - 1;

// By triangle: the number of its material, or of the first one that looks the same.
std::vector<std::size_t> materials_of_triangles(const meshio::ReadResult& read) {
    using Look =
        std::tuple<std::filesystem::path, const std::string*, vdtree::Wrap, vdtree::Wrap, std::array<float, 4>>;
    std::map<Look, std::size_t> first;
    std::map<std::string, std::size_t> numbers;
    for (std::size_t i = 0; i < read.materials.size(); ++i) {
        const meshio::Material& m = read.materials[i];
        const Look look{
            m.image, m.image_bytes.get(), m.wrap_u, m.wrap_v, {m.colour.r, m.colour.g, m.colour.b, m.colour.a}};
        numbers.emplace(m.name, first.try_emplace(look, i).first->second);
    }
    std::vector<std::size_t> of(read.mesh.triangles.size(), no_material);
    for (const MeshRange& range : read.mesh.ranges) {
        const auto found = numbers.find(range.name);
        if (range.kind != MeshRange::Kind::material || found == numbers.end()) continue;
        std::fill_n(of.begin() + static_cast<std::ptrdiff_t>(range.first_triangle), range.triangle_count,
                    found->second);
    }
    return of;
}

// Gives every vertex one material: those that several use are doubled.
std::vector<std::size_t> part_vertices(Mesh& mesh, const std::vector<std::size_t>& of_triangle) {
    std::vector<std::size_t> of_vertex(mesh.positions.size(), unused);
    std::map<std::pair<Index, std::size_t>, Index> doubled;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        for (Index& v : mesh.triangles[t]) {
            if (of_vertex[v] == unused) of_vertex[v] = of_triangle[t];
            if (of_vertex[v] == of_triangle[t]) continue;
            const auto [entry, is_new] =
                doubled.try_emplace({v, of_triangle[t]}, static_cast<Index>(mesh.positions.size()));
            if (is_new) {
                of_vertex.push_back(of_triangle[t]);
                mesh.positions.push_back(glm::dvec3(mesh.positions[v]));
                mesh.uvs.push_back(glm::vec2(mesh.uvs[v]));
                if (!mesh.normals.empty()) mesh.normals.push_back(glm::vec3(mesh.normals[v]));
                if (!mesh.colours.empty()) mesh.colours.push_back(glm::vec4(mesh.colours[v]));
            }
            v = entry->second;
        }
    }
    return of_vertex;
}

// The images that are asked for, each decoded once.
class Images {
public:
    Images(std::filesystem::path mesh_file, bool from_top) : mesh_file_(std::move(mesh_file)), from_top_(from_top) {}

    Result<const Texture*> of(const meshio::Material& material) {
        const bool is_embedded = material.image.empty();
        const std::filesystem::path file =
            is_embedded ? std::filesystem::path(mesh_file_.string() + ": the image of material '" + material.name + "'")
                        : mesh_file_.parent_path() / material.image;
        auto [entry, is_new] =
            images_.try_emplace({material.image, material.image_bytes.get(), material.wrap_u, material.wrap_v});
        if (is_new) {
            auto texture =
                is_embedded ? decode_texture(*material.image_bytes, file, from_top_) : read_texture(file, from_top_);
            if (!texture) return Error{texture.error().code, with_advice(texture.error().message)};
            entry->second = std::move(*texture);
            entry->second.wrap_u = material.wrap_u;
            entry->second.wrap_v = material.wrap_v;
        }
        return &entry->second;
    }

private:
    std::filesystem::path mesh_file_;
    bool from_top_;
    std::map<std::tuple<std::filesystem::path, const std::string*, vdtree::Wrap, vdtree::Wrap>, Texture> images_;
};

// Multiplies materials' colours into those of the vertices.
void colour_vertices(Mesh& mesh, const std::vector<Material>& materials, const std::vector<std::size_t>& of_vertex) {
    const auto is_white = [&](std::size_t m) { return m >= materials.size() || materials[m].colour == glm::vec4(1); };
    if (std::all_of(of_vertex.begin(), of_vertex.end(), is_white)) return;
    if (mesh.colours.empty()) mesh.colours.assign(mesh.positions.size(), glm::vec4(1));
    for (std::size_t v = 0; v < of_vertex.size(); ++v)
        if (!is_white(of_vertex[v])) mesh.colours[v] *= materials[of_vertex[v]].colour;
}

// Without an image, of materials' opacity only: where vertices have colours at all, which make it known.
void thin_vertices(Mesh& mesh, const std::vector<Material>& materials, const std::vector<std::size_t>& of_triangle) {
    if (mesh.colours.empty()) return;
    for (std::size_t t = 0; t < of_triangle.size(); ++t) {
        if (of_triangle[t] == no_material) continue;
        for (const Index v : mesh.triangles[t])
            mesh.colours[v].a = std::min(mesh.colours[v].a, materials[of_triangle[t]].colour.a);
    }
}

Result<void> check_uvs(const std::filesystem::path& mesh_file, const meshio::ReadResult& read) {
    if (read.mesh.uvs.empty())
        return Error{
            ErrorCode::malformed_data,
            with_advice(mesh_file.string() + ": it has a texture but no texture coordinates, which say where it lies")};
    if (read.bad_uv)
        return Error{ErrorCode::malformed_data,
                     with_advice(mesh_file.string() + ": the texture coordinates of vertex " +
                                 std::to_string(*read.bad_uv) + " are not finite; correct them")};
    return {};
}

Result<void> lay_one(const std::filesystem::path& mesh_file, meshio::ReadResult& read,
                     const std::filesystem::path& image) {
    if (const auto ok = check_uvs(mesh_file, read); !ok) return ok;
    auto texture = read_texture(image, read.uvs_from_top);
    if (!texture) return texture.error();
    read.mesh.texture = std::move(*texture);
    return {};
}

// Materials without an image, and triangles without a material, get a white one.
Result<void> lay_materials(const std::filesystem::path& mesh_file, meshio::ReadResult& read) {
    Mesh& mesh = read.mesh;
    const std::vector<std::size_t> of_triangle = materials_of_triangles(read);
    const auto has_image = [&](std::size_t m) { return m != no_material && read.materials[m].has_image(); };
    if (std::none_of(of_triangle.begin(), of_triangle.end(), has_image)) {
        thin_vertices(mesh, read.materials, of_triangle);
        return {};
    }
    if (const auto ok = check_uvs(mesh_file, read); !ok) return ok;
    const std::vector<std::size_t> of_vertex = part_vertices(mesh, of_triangle);

    Images images(mesh_file, read.uvs_from_top);
    static const Texture white{1, 1, vdtree::Wrap::clamp, vdtree::Wrap::clamp, {{255, 255, 255, 255}}};
    std::vector<const Texture*> of_material(read.materials.size() + 1, &white); // the last: no material
    std::vector<AtlasPart> parts;
    std::map<const Texture*, std::size_t> part_of;
    std::vector<std::size_t> part_of_vertex(of_vertex.size(), 0);
    for (const std::size_t m : of_triangle) {
        if (!has_image(m) || of_material[m] != &white) continue;
        auto image = images.of(read.materials[m]);
        if (!image) return image.error();
        of_material[m] = *image;
    }
    for (std::size_t v = 0; v < of_vertex.size(); ++v) {
        if (of_vertex[v] == unused) continue;
        const std::size_t m = std::min(of_vertex[v], read.materials.size());
        const auto [entry, is_new] = part_of.try_emplace(of_material[m], parts.size());
        if (is_new)
            parts.push_back({m < read.materials.size() ? "material '" + read.materials[m].name + "'" : "no material",
                             of_material[m],
                             {}});
        part_of_vertex[v] = entry->second;
        if (of_material[m] == &white) mesh.uvs[v] = glm::vec2(0.5f);
        parts[entry->second].used.include(mesh.uvs[v]);
    }
    colour_vertices(mesh, read.materials, of_vertex);
    if (parts.size() == 1) {
        mesh.texture = *parts[0].texture;
        return {};
    }
    auto atlas = make_atlas(parts);
    if (!atlas) return Error{atlas.error().code, with_advice(mesh_file.string() + ": " + atlas.error().message)};
    for (std::size_t v = 0; v < of_vertex.size(); ++v) { // those that are not used get some place, too
        const AtlasPlace& place = atlas->places[part_of_vertex[v]];
        mesh.uvs[v] = glm::vec2(place.scale * glm::dvec2(mesh.uvs[v]) + place.offset);
    }
    mesh.texture = std::move(atlas->texture);
    return {};
}

} // namespace

Result<void> lay_texture(const std::filesystem::path& mesh_file, meshio::ReadResult& read, const LoadOptions& options) {
    if (options.without_textures) return {};
    return options.texture.empty() ? lay_materials(mesh_file, read) : lay_one(mesh_file, read, options.texture);
}

} // namespace unseen::session
