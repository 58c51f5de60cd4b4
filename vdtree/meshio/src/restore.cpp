#include "restore.h"

#include <limits>
#include <map>

#include <glm/common.hpp>
#include <glm/matrix.hpp>

#include <unseen/vdtree/internal/vertex_tree_data.h>

#include "gltf_document.h"
#include "mesh_readers.h"

namespace unseen::meshio {

namespace {

using Part = SourceDocument::Part;

// Matrices that flatten more than this, by share of their size, are not turned back.
constexpr double least_determinant = 1e-12;

// The linear function that fits values best (least squares), of differences from the mean.
template <int n>
class LinearFit {
public:
    using Place = glm::vec<n, double>;
    void add(const Place& d, const glm::dvec4& value) {
        spread_ += glm::outerProduct(d, d);
        for (int k = 0; k < n; ++k) slopes_[static_cast<std::size_t>(k)] += d[k] * value;
    }
    void solve() {
        double size = 0;
        for (int k = 0; k < n; ++k) size += spread_[k][k];
        // Across the surface nothing is known: there the least share of the spread that floats still tell from none.
        constexpr double least_share = 1e-7;
        inverse_ = size > 0 ? glm::inverse(spread_ / size + Matrix(least_share)) / size : Matrix(0);
    }
    glm::dvec4 at(const Place& d) const {
        const Place to = inverse_ * d;
        glm::dvec4 value(0);
        for (int k = 0; k < n; ++k) value += to[k] * slopes_[static_cast<std::size_t>(k)];
        return value;
    }

private:
    using Matrix = glm::mat<n, n, double>;
    Matrix spread_{0}, inverse_{0};
    std::array<glm::dvec4, n> slopes_{};
};

class Restorer {
public:
    Restorer(const VertexTree& tree, const LeafRuns& leaves, const ExtractedMesh& extracted,
             const SourceDocument& document, const std::vector<std::string>& uvs)
        : tree_(tree), leaves_(leaves), extracted_(extracted), document_(document), uvs_(uvs),
          numbers_(extracted.wedges.size(), none) {}

    std::vector<RestoredPart> run() {
        std::map<std::uint32_t, RestoredPart> parts;
        std::size_t run = 0;
        const auto& runs = document_.runs;
        for (std::size_t t = 0; t < extracted_.source_triangles.size(); ++t) {
            while (run + 1 < runs.size() && runs[run + 1].first_triangle <= extracted_.source_triangles[t]) ++run;
            parts[runs[run].part].triangles.push_back(extracted_.mesh.triangles[t]);
        }
        std::vector<RestoredPart> out;
        for (auto& [number, part] : parts) {
            part.part = number;
            fill(part);
            out.push_back(std::move(part));
        }
        return out;
    }

private:
    static constexpr Index none = std::numeric_limits<Index>::max();

    void fill(RestoredPart& out) {
        const Part& part = document_.parts[out.part];
        const NodeFrame frame = frame_of(part.to_world);
        out.is_in_world = !frame.has_inverse;
        for (Triangle& triangle : out.triangles) {
            for (Index& corner : triangle) {
                Index& number = numbers_[corner];
                if (number == none) {
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
            numbers_[v] = none;
            const glm::dvec3 p = extracted_.mesh.positions[v];
            out.positions.emplace_back(frame.from_world * glm::dvec4(p, 1.0));
            for (std::size_t c = 0; c < out.channels.size(); ++c)
                if ((part.channels >> c & 1) || is_normal(c)) append(out.channels[c], c, v, out, frame);
        }
    }

    bool is_normal(std::size_t channel) const {
        return document_.channels[channel].name == "NORMAL" && document_.channels[channel].components == 3;
    }

    // Leaves of one wedge have one material, and so they are drawn in one way. But some may lack an attribute that others
    // have.
    bool has(Index source, std::size_t channel) const {
        return document_.parts[document_.vertex_parts[source]].channels >> channel & 1;
    }

    // What the values of a wedge's leaves say of a proxy: the linear function of the drawn coordinates that fits best, and
    // one of the place for what is left (least squares), at the proxy. So what is linear over a flat surface stays that,
    // and one set of coordinates goes with another where the surface is bent.
    std::array<double, 4> value_at(std::size_t number, WedgeId wedge, bool& have_all) const {
        const SourceDocument::Channel& channel = document_.channels[number];
        const std::span<const glm::vec2> uvs = tree_.uvs();
        const auto uv_of = [&](WedgeId of) { return uvs.empty() ? glm::dvec2(0) : glm::dvec2(uvs[of]); };
        const auto place_of = [&](WedgeId of) { return glm::dvec3(tree_.positions()[of]); };
        const auto for_each = [&](auto&& visit) {
            for (Index rank = leaves_.begin(wedge); rank < leaves_.end(wedge); ++rank) {
                const Index leaf = leaves_.leaf(rank), source = tree_.source_vertices()[leaf];
                if (!has(source, number)) {
                    have_all = false;
                    continue;
                }
                glm::dvec4 value(0);
                for (std::uint32_t k = 0; k < channel.components; ++k)
                    value[static_cast<int>(k)] = channel.values[source * std::size_t{channel.components} + k];
                visit(tree_.wedge_of_leaf(leaf), value);
            }
        };
        constexpr double infinity = std::numeric_limits<double>::infinity();
        double count = 0;
        glm::dvec2 uv(0);
        glm::dvec3 place(0);
        glm::dvec4 mean(0), low(infinity), high(-infinity);
        for_each([&](WedgeId leaf, const glm::dvec4& value) {
            ++count, uv += uv_of(leaf), place += place_of(leaf), mean += value;
            low = glm::min(low, value), high = glm::max(high, value);
        });
        if (count == 0) return {};
        uv /= count, place /= count, mean /= count;
        LinearFit<2> by_uv;
        for_each([&](WedgeId leaf, const glm::dvec4& value) { by_uv.add(uv_of(leaf) - uv, value - mean); });
        by_uv.solve();
        LinearFit<3> by_place;
        for_each([&](WedgeId leaf, const glm::dvec4& value) {
            by_place.add(place_of(leaf) - place, value - mean - by_uv.at(uv_of(leaf) - uv));
        });
        by_place.solve();
        const glm::dvec4 fitted = mean + by_uv.at(uv_of(wedge) - uv) + by_place.at(place_of(wedge) - place);
        // Coordinates lie beyond those of the leaves, too, as the drawn ones do: a proxy is not between its leaves.
        const glm::dvec4 beyond = channel.name.starts_with("TEXCOORD_") ? (high - low) / 2.0 : glm::dvec4(0);
        std::array<double, 4> values{};
        for (int k = 0; k < 4; ++k)
            values[static_cast<std::size_t>(k)] =
                std::isfinite(fitted[k]) ? std::clamp(fitted[k], low[k] - beyond[k], high[k] + beyond[k]) : mean[k];
        return values;
    }

    void append(std::vector<float>& to, std::size_t number, Index vertex, const RestoredPart& of,
                const NodeFrame& frame) const {
        const Part& part = document_.parts[of.part];
        const SourceDocument::Channel& channel = document_.channels[number];
        const std::size_t size = channel.components;
        const WedgeId wedge = extracted_.wedges[vertex];
        if (wedge >= tree_.interior_wedge_count() && (frame.has_inverse || !is_normal(number))) { // as it was
            const auto own = std::span(channel.values)
                                 .subspan(tree_.source_vertices()[leaves_.leaf(leaves_.begin(wedge))] * size, size);
            const bool is_missing = is_normal(number) && std::ranges::count(own, 0.0f) == 3;
            if (!is_missing) return void(to.insert(to.end(), own.begin(), own.end()));
        }
        bool have_all = true;
        std::array<double, 4> values = value_at(number, wedge, have_all);
        const Mesh& mesh = extracted_.mesh;
        if (is_normal(number)) {
            const glm::dvec3 n = frame.normal_from_world * glm::dvec3(mesh.normals[vertex]);
            const double length = glm::length(n);
            for (int k = 0; k < 3; ++k) // of unit length, even where no triangle around has a normal
                values[static_cast<std::size_t>(k)] = length > 0 ? n[k] / length : k == 2;
        } else if (channel.name == of.uvs && have_all && size == 2 && !mesh.uvs.empty()) {
            const double determinant = glm::determinant(part.drawn_uv.linear);
            if (determinant != 0 && std::isfinite(1 / determinant)) {
                const glm::dvec2 uv =
                    glm::inverse(part.drawn_uv.linear) * (glm::dvec2(mesh.uvs[vertex]) - part.drawn_uv.offset);
                values[0] = uv.x, values[1] = uv.y;
            }
        } else if (channel.name == "COLOR_0" && have_all && size >= 3 && !mesh.colours.empty()) {
            for (int k = 0; k < static_cast<int>(size); ++k)
                if (part.colour[k] > 0)
                    values[static_cast<std::size_t>(k)] =
                        static_cast<double>(mesh.colours[vertex][k]) / static_cast<double>(part.colour[k]);
        }
        for (std::size_t k = 0; k < size; ++k) to.push_back(static_cast<float>(values[k]));
    }

    const VertexTree& tree_;
    const LeafRuns& leaves_;
    const ExtractedMesh& extracted_;
    const SourceDocument& document_;
    const std::vector<std::string>& uvs_; // by part
    std::vector<Index> numbers_;          // by vertex of the extracted mesh: its number in the part at hand
};

} // namespace

Result<SourceDocument> document_of(const VertexTree& tree) {
    auto document = unpack(tree.document());
    if (!document || document->format == SourceDocument::Format::table) return document;
    auto& channels = document->channels;
    const bool has_normals = std::ranges::any_of(
        channels, [](const SourceDocument::Channel& c) { return c.name == "NORMAL" && c.components == 3; });
    constexpr std::size_t most = 32; // bits of Part::channels
    if (!has_normals && channels.size() < most)
        channels.push_back({"NORMAL", 3, std::vector<float>(3 * document->vertex_parts.size(), 0.0f)});
    return document;
}

Result<LeafRuns> leaves_of_wedges(const VertexTree& tree, std::size_t vertices) {
    if (const auto sound = SoundTree::of(tree); !sound) return sound.error();
    if (tree.source_vertex_count() != vertices)
        return Error{ErrorCode::malformed_data,
                     "The source document is not that of the tree's mesh. Build the tree again."};
    return LeafRuns(links_of(*tree.data().geometry));
}

std::vector<NodeId> nodes_of(const VertexTree& tree, const ExtractedMesh& extracted) {
    std::vector<NodeId> nodes(extracted.wedges.begin(), extracted.wedges.end());
    for (NodeId& node : nodes) {
        NodeId low = 0;
        for (NodeId end = tree.node_count(); tree.has_seams() && end - low > 1;) {
            const NodeId middle = low + (end - low) / 2;
            (tree.first_wedge(middle) <= node ? low : end) = middle;
        }
        if (tree.has_seams()) node = low;
    }
    return nodes;
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
        uvs[i] = gltf::uv_attribute(gltf::uv_set_of(gltf::leading_texture(used)).value_or(0));
    }
    return uvs;
}

Result<std::vector<RestoredPart>> restore(const Cut& cut, const ExtractedMesh& extracted,
                                          const SourceDocument& document, const std::vector<std::string>& uvs) {
    const bool has_sources = extracted.source_triangles.size() == extracted.mesh.triangles.size();
    const auto leaves = leaves_of_wedges(cut.tree(), has_sources ? document.vertex_parts.size() : 0);
    if (!leaves) return leaves.error();
    return Restorer(cut.tree(), *leaves, extracted, document, uvs).run();
}

} // namespace unseen::meshio
