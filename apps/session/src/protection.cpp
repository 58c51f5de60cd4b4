// What of a mesh is to be kept, from the names of its materials and from files of shares.
#include <algorithm>

#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/input_file.h>
#include <unseen/vdtree/internal/names.h>
#include <unseen/vdtree/internal/number_text.h>

#include "loaded_tree.h"

namespace unseen::session {
namespace {

using Kind = Protection::Kind;

// Of a vertex that is protected by a share of the weight.
float share_of(float weight, float share) {
    if (!(share > 0)) return 1;
    return weight < vdtree::never_folds ? 1 + share * (weight - 1) : weight;
}

void add_material(meshio::ReadResult& read, const Protection& protection) {
    for (const vdtree::MeshRange& range : read.mesh.ranges) {
        if (range.kind != vdtree::MeshRange::Kind::material || range.name != protection.name) continue;
        const auto triangles = std::span(read.mesh.triangles).subspan(range.first_triangle, range.triangle_count);
        for (const vdtree::Triangle& triangle : triangles)
            for (const vdtree::Index v : triangle)
                read.mesh.weights[v] = std::max(read.mesh.weights[v], protection.weight);
    }
}

Result<void> add_vertices(meshio::ReadResult& read, const Protection& protection) {
    const auto text = read_text_file(protection.name);
    if (!text) return text.error();
    std::uint64_t line = 0;
    for (std::string_view rest = *text; !rest.empty();) {
        const std::size_t end = std::min(rest.find('\n'), rest.size());
        const std::string_view word = trimmed(rest.substr(0, end));
        rest.remove_prefix(std::min(end + 1, rest.size()));
        const auto share = number_from<float>(word);
        if (!share || !(*share >= 0 && *share <= 1))
            return Error{ErrorCode::malformed_data, protection.name + ":" + std::to_string(line + 1) + ": " +
                                                        in_quotes(word) + " must be a number from 0 to 1."};
        if (line < read.source_vertices) {
            float& weight = read.mesh.weights[line];
            weight = std::max(weight, share_of(protection.weight, *share));
        }
        ++line;
    }
    if (line == read.source_vertices) return {};
    return Error{ErrorCode::malformed_data,
                 protection.name + " has " + std::to_string(line) + " numbers for " +
                     std::to_string(read.source_vertices) +
                     " vertices: give one a line for each vertex of the mesh's file, in its order."};
}

} // namespace

float border_weight(std::span<const Protection> what) {
    float weight = 1;
    for (const Protection& protection : what)
        if (protection.kind == Kind::borders) weight = std::max(weight, protection.weight);
    return weight;
}

Result<void> find_weights(meshio::ReadResult& read, std::span<const Protection> what) {
    if (std::ranges::all_of(what, [](const Protection& p) { return p.kind == Kind::borders; })) return {};
    read.mesh.weights.assign(read.mesh.positions.size(), 1);
    for (const Protection& protection : what) {
        if (protection.kind == Kind::material) add_material(read, protection);
        if (protection.kind == Kind::vertices)
            if (const auto added = add_vertices(read, protection); !added) return added;
    }
    return {};
}

Result<void> check_protected(const std::set<std::string>& materials, std::span<const Protection> what) {
    constexpr std::size_t most = 12; // names that a sentence lists
    for (const Protection& protection : what) {
        if (protection.kind != Kind::material || materials.contains(protection.name)) continue;
        std::string list;
        for (const std::string& name : materials)
            if (std::ranges::count(list, '\'') < 2 * std::ptrdiff_t{most})
                list += (list.empty() ? "" : ", ") + in_quotes(name);
        return invalid_field("{load.protect}: there is no material {}; {}.",
                             {in_quotes(protection.name), list.empty()              ? "the model has none"
                                                          : materials.size() > most ? "there are " + list + " and more"
                                                                                    : "there are " + list});
    }
    return {};
}

Result<void> protect(meshio::ReadResult& read, std::span<const Protection> what) {
    std::set<std::string> materials;
    for (const vdtree::MeshRange& range : read.mesh.ranges)
        if (range.kind == vdtree::MeshRange::Kind::material) materials.insert(range.name);
    if (const auto known = check_protected(materials, what); !known) return known;
    return find_weights(read, what);
}

} // namespace unseen::session
