#include "restore.h"

#include <map>
#include <tuple>

#include <glm/matrix.hpp>

#include "gltf_document.h"
#include "mesh_readers.h"

namespace unseen::meshio {

namespace {

using Part = SourceDocument::Part;

// Matrices that flatten more than this, by share of their size, are not turned back.
constexpr double least_determinant = 1e-12;

class Restorer {
public:
    Restorer(const Cut& cut, const ExtractedMesh& extracted, const SourceDocument& document,
             const std::vector<std::string>& uvs)
        : tree_(cut.tree()), extracted_(extracted), document_(document), uvs_(uvs),
          supports_(supports_of(cut, extracted)) {
        find_kinds();
    }

    Result<std::vector<RestoredPart>> run() {
        const std::size_t vertices =
            extracted_.source_triangles.size() == extracted_.mesh.triangles.size() ? document_.vertex_parts.size() : 0;
        if (const auto sound = check_supports(tree_, supports_, vertices); !sound) return sound.error();
        std::map<std::uint32_t, RestoredPart> parts;
        std::size_t run = 0;
        const auto& runs = document_.runs;
        for (std::size_t t = 0; t < extracted_.source_triangles.size(); ++t) {
            while (run + 1 < runs.size() && runs[run + 1].first_triangle <= extracted_.source_triangles[t]) ++run;
            parts[runs[run].part].triangles.push_back(extracted_.mesh.triangles[t]);
        }
        std::vector<RestoredPart> out;
        numbers_.assign(extracted_.nodes.size(), no_node);
        for (auto& [number, part] : parts) {
            part.part = number;
            fill(part);
            out.push_back(std::move(part));
        }
        return out;
    }

private:
    // Parts of one kind have the same attributes, drawn in the same way.
    void find_kinds() {
        std::map<std::tuple<std::uint32_t, std::string, std::array<double, 10>>, std::uint32_t> kinds;
        for (std::size_t i = 0; i < document_.parts.size(); ++i) {
            const Part& part = document_.parts[i];
            const UvMap& uv = part.drawn_uv;
            const glm::dvec4 colour(part.colour);
            const std::array drawing{uv.linear[0][0], uv.linear[0][1], uv.linear[1][0], uv.linear[1][1], uv.offset.x,
                                     uv.offset.y,     colour.r,        colour.g,        colour.b,        colour.a};
            const auto next = static_cast<std::uint32_t>(kinds.size());
            kinds_.push_back(kinds.try_emplace({part.channels, uvs_[i], drawing}, next).first->second);
        }
    }

    void fill(RestoredPart& out) {
        const Part& part = document_.parts[out.part];
        const NodeFrame frame = frame_of(part.to_world);
        out.is_in_world = !frame.has_inverse;
        for (Triangle& triangle : out.triangles) {
            for (Index& corner : triangle) {
                Index& number = numbers_[corner];
                if (number == no_node) {
                    number = static_cast<Index>(out.vertices.size());
                    out.vertices.push_back(corner);
                }
                corner = number;
            }
            if (frame.is_mirrored) std::swap(triangle[0], triangle[1]);
        }
        out.uvs = uvs_[out.part];
        out.channels.resize(document_.channels.size());
        for (const Index v : out.vertices) {
            numbers_[v] = no_node;
            const glm::dvec3 p = extracted_.mesh.positions[v];
            out.positions.emplace_back(frame.from_world * glm::dvec4(p, 1.0));
            gather(v, out.part);
            for (std::size_t c = 0; c < out.channels.size(); ++c)
                if (part.channels >> c & 1) append(out.channels[c], document_.channels[c], v, out, frame);
        }
    }

    // What speaks for a vertex in a part.
    void gather(Index vertex, std::uint32_t part) {
        const LeafRange support = supports_[vertex];
        const auto all = tree_.source_vertices().subspan(support.first, support.end - support.first);
        like_.clear();
        for (const Index source : all)
            if (kinds_[document_.vertex_parts[source]] == kinds_[part]) like_.push_back(source);
        is_pure_ = like_.size() == all.size();
        if (like_.empty()) like_.assign(all.begin(), all.end());
    }

    void append(std::vector<float>& to, const SourceDocument::Channel& channel, Index vertex, const RestoredPart& of,
                const NodeFrame& frame) const {
        const Part& part = document_.parts[of.part];
        const std::size_t size = channel.components;
        const bool is_normal = channel.name == "NORMAL" && size == 3;
        if (tree_.is_leaf(extracted_.nodes[vertex]) && (frame.has_inverse || !is_normal)) { // as it was
            for (std::size_t k = 0; k < size; ++k) to.push_back(channel.values[like_[0] * size + k]);
            return;
        }
        std::array<double, 4> values{};
        for (std::size_t k = 0; k < size; ++k) {
            for (const Index source : like_) values[k] += static_cast<double>(channel.values[source * size + k]);
            values[k] /= static_cast<double>(std::max<std::size_t>(like_.size(), 1));
        }
        const Mesh& mesh = extracted_.mesh;
        if (is_normal) {
            const glm::dvec3 n = frame.normal_from_world * glm::dvec3(mesh.normals[vertex]);
            const double length = glm::length(n);
            for (int k = 0; k < 3; ++k) values[static_cast<std::size_t>(k)] = length > 0 ? n[k] / length : 0.0;
        } else if (channel.name == of.uvs && is_pure_ && size == 2 && !mesh.uvs.empty()) {
            const double determinant = glm::determinant(part.drawn_uv.linear);
            if (determinant != 0 && std::isfinite(1 / determinant)) {
                const glm::dvec2 uv =
                    glm::inverse(part.drawn_uv.linear) * (glm::dvec2(mesh.uvs[vertex]) - part.drawn_uv.offset);
                values[0] = uv.x, values[1] = uv.y;
            }
        } else if (channel.name == "COLOR_0" && is_pure_ && size >= 3 && !mesh.colours.empty()) {
            for (int k = 0; k < static_cast<int>(size); ++k)
                if (part.colour[k] > 0)
                    values[static_cast<std::size_t>(k)] =
                        static_cast<double>(mesh.colours[vertex][k]) / static_cast<double>(part.colour[k]);
        }
        for (std::size_t k = 0; k < size; ++k) to.push_back(static_cast<float>(values[k]));
    }

    const VertexTree& tree_;
    const ExtractedMesh& extracted_;
    const SourceDocument& document_;
    const std::vector<std::string>& uvs_; // by part
    std::vector<LeafRange> supports_;     // by vertex of the extracted mesh
    std::vector<std::uint32_t> kinds_;    // by part
    std::vector<Index> numbers_;          // by vertex of the extracted mesh: its number in the part at hand
    std::vector<Index> like_;             // what speaks for the vertex at hand
    bool is_pure_ = false;                // all that it stands for
};

} // namespace

std::vector<LeafRange> supports_of(const Cut& cut, const ExtractedMesh& extracted) {
    const VertexTree& tree = cut.tree();
    std::vector<Index> vertex_of_node(tree.node_count(), no_node);
    for (std::size_t v = 0; v < extracted.nodes.size(); ++v) vertex_of_node[extracted.nodes[v]] = static_cast<Index>(v);
    std::vector<LeafRange> supports(extracted.nodes.size());
    for (Index leaf = 0; leaf < tree.leaf_count(); ++leaf) {
        const Index vertex = vertex_of_node[cut.proxy_of_leaf(leaf)];
        if (vertex == no_node) continue;
        LeafRange& support = supports[vertex];
        if (support.end == 0) support.first = leaf;
        support.end = leaf + 1;
    }
    return supports;
}

Result<void> check_supports(const VertexTree& tree, std::span<const LeafRange> supports, std::size_t vertices) {
    for (const LeafRange& support : supports)
        for (Index leaf = support.first; leaf < support.end; ++leaf)
            if (tree.source_vertices()[leaf] >= vertices)
                return Error{ErrorCode::malformed_data,
                             "The source document is not that of the tree's mesh. Build the tree again."};
    return {};
}

NormalMatrix normal_matrix_of(const glm::dmat3& m) {
    const glm::dmat3 cofactors(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
    const bool is_mirrored = glm::dot(m[0], cofactors[0]) < 0;
    return {is_mirrored ? -cofactors : cofactors, is_mirrored};
}

NodeFrame frame_of(const glm::dmat4& to_world) {
    NodeFrame frame;
    glm::dmat3 linear(to_world);
    double size = 0;
    for (int i = 0; i < 9; ++i) size = std::max(size, std::abs(linear[i / 3][i % 3]));
    if (!(size > 0)) return frame;
    linear /= size; // a determinant of tiny scales would underflow
    const double determinant = glm::determinant(linear);
    const glm::dmat3 inverse = glm::inverse(linear) / size;
    const glm::dvec3 offset = -inverse * glm::dvec3(to_world[3]);
    frame.has_inverse = std::abs(determinant) > least_determinant && std::isfinite(glm::length(offset));
    for (int i = 0; i < 9; ++i) frame.has_inverse = frame.has_inverse && std::isfinite(inverse[i / 3][i % 3]);
    if (!frame.has_inverse) return frame;
    frame.is_mirrored = determinant < 0;
    frame.from_world = glm::dmat4(inverse);
    frame.from_world[3] = glm::dvec4(offset, 1.0);
    frame.normal_from_world = glm::transpose(linear);
    return frame;
}

std::vector<std::string> drawn_uvs(const SourceDocument& document) {
    std::vector<std::string> uvs(document.parts.size(), gltf::uv_attribute(0));
    if (document.format != SourceDocument::Format::gltf) return uvs;
    const gltf::json source = gltf::parse_json(document.json);
    for (std::size_t i = 0; i < uvs.size(); ++i) {
        const auto element = [](const gltf::json& array, std::int32_t number) -> const gltf::json& {
            return array.at(static_cast<std::size_t>(number));
        };
        const Part& part = document.parts[i];
        const gltf::json& mesh = element(gltf::array_of(source, "meshes"), part.mesh);
        const gltf::json& material = gltf::within(element(mesh.at("primitives"), part.primitive), {"material"});
        if (material.is_null()) continue;
        const gltf::json& used = gltf::array_of(source, "materials").at(material.get<std::size_t>());
        uvs[i] = gltf::uv_attribute(gltf::colour_uv_set(used).value_or(0));
    }
    return uvs;
}

Result<std::vector<RestoredPart>> restore(const Cut& cut, const ExtractedMesh& extracted,
                                          const SourceDocument& document, const std::vector<std::string>& uvs) {
    return Restorer(cut, extracted, document, uvs).run();
}

} // namespace unseen::meshio
