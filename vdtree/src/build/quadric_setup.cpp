#include "build/quadric_setup.h"

#include <limits>
#include <numeric>

#include <glm/geometric.hpp>

namespace unseen::vdtree {

namespace {

// Weights of the planes that stand on edges, against those of triangles, for half the edge's length squared at each of its
// ends.
constexpr double boundary_weight = 4; // edges of one triangle, and of more than two
constexpr double material_weight = 2;
constexpr double uv_seam_weight = 1;
// For a right angle between the normals of both sides; by what the normals have in common it is less, for files are full of
// slight splits.
constexpr double hard_edge_weight = 0.3;
// Areas may be tiny or zero; every place keeps a little weight of its own.
constexpr float least_weight = 1e-6f; // share of the largest area of a place

constexpr Index no_entry = std::numeric_limits<Index>::max();

class PartSetup {
public:
    explicit PartSetup(const PartMesh& part)
        : part_(part), own_(part.own_slots), classes_(part.classes), channels_(classes_.total_channels()),
          stride_(classes_.stride()), live_(result_.live) {
        result_.first_slot = part.first_slot;
        result_.end_slot = part.first_slot + own_;
        result_.first_leaf = part.first_leaf;
        result_.end_leaf = part.first_leaf + part.own_leaves;
        result_.classes = classes_;
    }

    Contraction run() {
        make_clusters();
        for (std::size_t i = 0; i < part_.ghost_leaves.size(); ++i)
            result_.outside.push_back({part_.ghost_leaves[i], corner(part_.own_leaves + static_cast<Index>(i))});
        add_triangles();
        find_edges();
        for (Index s = 0; s < part_.weights.size(); ++s) weigh(s, part_.weights[s] * part_.weights[s]);
        return std::move(result_);
    }

private:
    float* quadric_of(Index slot) { return live_.quadrics.data() + slot * stride_; }
    Index slot(Index leaf) const { return part_.slot_of_leaf[leaf]; }
    const float* values(Index leaf) const { return part_.channel_values.data() + leaf * channels_; }
    const float* values(Index leaf, std::size_t c) const { return values(leaf) + classes_.first_channel(c); }
    glm::dvec3 corner(Index leaf) const { return part_.positions[slot(leaf)]; }
    bool is_same(Index leaf, Index other, std::size_t c) const {
        return std::equal(values(leaf, c), values(leaf, c) + classes_.channels[c], values(other, c));
    }

    void make_clusters() {
        for (Index s = 0; s < own_; ++s) live_.clusters.push_back({part_.first_slot + s, 0});
        live_.places.assign(part_.positions.begin(), part_.positions.begin() + own_);
        live_.quadrics.assign(own_ * stride_, 0);
        live_.references.assign(own_ * channels_, 0);
        if (part_.own_leaves > own_) {
            live_.several.resize(own_);
            component_of_leaf_.assign(part_.own_leaves * classes_.count, no_entry);
        }
        for (Index leaf = 0, end = 0; leaf < part_.own_leaves; leaf = end) {
            while (end < part_.own_leaves && slot(end) == slot(leaf)) ++end;
            make_components(leaf, end);
        }
    }

    // A distance counts as if it were so many times as long; errors are its square.
    void weigh(Index s, float factor) {
        for (std::size_t i = 0; i < stride_; ++i) quadric_of(s)[i] *= factor;
        if (live_.is_simple(s)) return;
        for (Index k = 0; k < live_.several[s].count; ++k)
            for (float& value : live_.components[live_.several[s].first + k].block) value *= factor;
    }

    // Of the place that has the leaves `first` .. `end` - 1. At first every component has its leaves' value as reference.
    void make_components(Index first, Index end) {
        const Index s = slot(first);
        quadric_of(s)[quadric::weight] = least_weight;
        bool is_simple = true;
        for (Index leaf = first; leaf < end; ++leaf)
            is_simple &= std::equal(values(first), values(first) + channels_, values(leaf));
        if (is_simple) {
            std::copy_n(values(first), channels_, live_.references.data() + s * channels_);
            for (std::size_t c = 0; c < classes_.count; ++c) {
                for (Index leaf = first; leaf < end && !live_.several.empty(); ++leaf)
                    component_of_leaf_[leaf * classes_.count + c] = static_cast<Index>(c);
                quadric_of(s)[classes_.first_float(c + 1) - 1] = least_weight;
            }
            return;
        }
        const Index first_component = static_cast<Index>(live_.components.size());
        live_.components.resize(first_component + classes_.count);
        for (std::size_t c = 0; c < classes_.count; ++c) make_components(first, end, c, first_component);
        live_.several[s] = {first_component, static_cast<Index>(live_.components.size()) - first_component};
    }

    // Makes a component of a class for each distinct value. The first is at the class's own place, the others follow.
    void make_components(Index first, Index end, std::size_t c, Index first_component) {
        by_value_.resize(end - first);
        std::iota(by_value_.begin(), by_value_.end(), first);
        const std::size_t channels = classes_.channels[c];
        std::sort(by_value_.begin(), by_value_.end(), [&](Index a, Index b) {
            const float *x = values(a, c), *y = values(b, c);
            const auto [p, q] = std::mismatch(x, x + channels, y);
            return p == x + channels ? a < b : *p < *q;
        });
        Index number = static_cast<Index>(c);
        for (std::size_t i = 0; i < by_value_.size(); ++i) {
            const bool is_new = i == 0 || !is_same(by_value_[i - 1], by_value_[i], c);
            if (is_new && i > 0) {
                number = static_cast<Index>(live_.components.size()) - first_component;
                live_.components.emplace_back();
            }
            if (is_new) {
                ClassComponent& made = live_.components[first_component + number];
                made.attribute_class = static_cast<Index>(c);
                std::copy_n(values(by_value_[i], c), channels, made.references.begin());
                made.block[channels * quadric::row_size] = least_weight;
            }
            component_of_leaf_[by_value_[i] * classes_.count + c] = number;
        }
    }

    // Of a slot with several components.
    float* block_of(Index leaf, Index s, std::size_t c) {
        return live_.components[live_.several[s].first + component_of_leaf_[leaf * classes_.count + c]].block.data();
    }

    LeafComponents components_of(Index leaf) const {
        LeafComponents out{};
        for (Index c = 0; c < classes_.count; ++c)
            out[c] = live_.several.empty() ? c : component_of_leaf_[leaf * classes_.count + c];
        return out;
    }

    static void add_plane(float* q, float strength, glm::vec3 n) {
        using namespace quadric;
        q[xx] += strength * n.x * n.x, q[xy] += strength * n.x * n.y, q[xz] += strength * n.x * n.z;
        q[yy] += strength * n.y * n.y, q[yz] += strength * n.y * n.z, q[zz] += strength * n.z * n.z;
    }

    void add_triangles() {
        result_.triangles.reserve(part_.triangles.size());
        const auto add_all = [&](const AttributeClasses classes) UNSEEN_INLINE_LAMBDA {
            for (const Triangle& t : part_.triangles) add_triangle(t, classes);
        };
        if (classes_ == only_normals) add_all(only_normals);
        else if (classes_ == normals_and_uvs) add_all(normals_and_uvs);
        else add_all(classes_);
    }

    // The plane, and each channel's linear function on it, for each own corner: they go through its place and through its
    // components' references. `classes` is classes_, as a constant where the compiler is to unroll.
    UNSEEN_INLINE void add_triangle(const Triangle& t, const AttributeClasses classes) {
        const std::array<Index, 3> slots{slot(t[0]), slot(t[1]), slot(t[2])};
        const glm::dvec3 p = part_.positions[slots[0]], e = part_.positions[slots[1]] - p,
                         f = part_.positions[slots[2]] - p;
        const glm::dvec3 cross = glm::cross(e, f);
        const double squared = glm::dot(cross, cross);
        LiveTriangle& live = result_.triangles.emplace_back();
        for (std::size_t k = 0; k < 3; ++k)
            live.corners[k] = slots[k] < own_ ? slots[k] : LiveTriangle::is_outside | (t[k] - part_.own_leaves);
        live.normal = glm::vec3(0);
        if (!(squared > 0)) return;
        const double length = std::sqrt(squared), inverse = 1 / squared;
        const float area = static_cast<float>(length * part_.area_scale / 6); // a third of the triangle's
        const glm::vec3 by_e(glm::cross(f, cross) * inverse), by_f(glm::cross(cross, e) * inverse);
        live.normal = glm::vec3(cross * (length * inverse));
        std::array<float, quadric::base_size> planes{};
        add_plane(planes.data(), area, live.normal);
        for (std::size_t c = 0; c < classes.count; ++c)
            add_class(t, slots, c, classes, by_e, by_f, area, planes.data());
        for (const Index s : slots) {
            if (s >= own_) continue;
            float* q = live_.quadrics.data() + s * classes.stride();
            for (std::size_t i = quadric::xx; i <= quadric::zz; ++i) q[i] += planes[i];
            q[quadric::weight] += area;
        }
    }

    // `by_e`, `by_f`: the gradients of functions that grow by 1 along one side from the first corner and not at all along
    // the other.
    UNSEEN_INLINE void add_class(const Triangle& t, const std::array<Index, 3>& slots, std::size_t c,
                                 const AttributeClasses classes, glm::vec3 by_e, glm::vec3 by_f, float area,
                                 float* planes) {
        using namespace quadric;
        const std::size_t channels = classes.channels[c], all = classes.total_channels();
        const float* first = part_.channel_values.data() + classes.first_channel(c);
        const float *v0 = first + t[0] * all, *v1 = first + t[1] * all, *v2 = first + t[2] * all;
        std::array<glm::vec3, most_class_channels> gradients;
        float steepest = 0;
        bool is_bounded = true;
        for (std::size_t i = 0; i < channels; ++i) {
            gradients[i] = (v1[i] - v0[i]) * by_e + (v2[i] - v0[i]) * by_f;
            const float slope = glm::dot(gradients[i], gradients[i]);
            is_bounded &= slope < std::numeric_limits<float>::max();
            steepest = std::max(steepest, slope);
        }
        if (!is_bounded) return;
        const float weight_here = area / (1 + steepest);
        std::array<Float4, most_class_channels> rows;
        for (std::size_t i = 0; i < channels; ++i) {
            const glm::vec3& g = gradients[i];
            add_plane(planes, weight_here, g);
            rows[i] = Float4{g.x, g.y, g.z} * weight_here;
        }
        for (std::size_t k = 0; k < 3; ++k) {
            if (slots[k] >= own_) continue;
            float* row = live_.is_simple(slots[k])
                             ? live_.quadrics.data() + slots[k] * classes.stride() + classes.first_float(c)
                             : block_of(t[k], slots[k], c);
            for (std::size_t i = 0; i < channels; ++i, row += row_size) {
                Float4 sum;
                std::memcpy(&sum, row, sizeof(sum));
                sum += rows[i];
                std::memcpy(row, &sum, sizeof(sum));
            }
            *row += weight_here; // the block's
        }
    }

    // One side of a triangle; lower and higher local slot.
    struct Use {
        Index high;
        Index side; // triangle * 3 + its first corner
    };

    // From a lower slot, with its sides of triangles.
    struct Edge {
        Index high, side, second_side = no_entry, uses = 1;
    };

    // Every edge with an own end: within the part a pair, to a ghost an outer edge.
    void find_edges() {
        std::vector<Index> start(own_ + 1, 0);
        const auto for_each_side = [&](auto&& f) {
            for (Index t = 0; t < part_.triangles.size(); ++t) {
                const Triangle& tri = part_.triangles[t];
                for (Index c = 0; c < 3; ++c) {
                    const Index a = slot(tri[c]), b = slot(tri[c == 2 ? 0 : c + 1]);
                    if (a != b && std::min(a, b) < own_) f(std::min(a, b), std::max(a, b), t * 3 + c);
                }
            }
        };
        for_each_side([&](Index low, Index, Index) { ++start[low + 1]; });
        std::partial_sum(start.begin(), start.end(), start.begin());
        std::vector<Use> uses(start.back());
        for_each_side([&](Index low, Index high, Index side) { uses[start[low]++] = {high, side}; });
        // Filling has moved each start to its end.
        std::vector<Index> seen_from(part_.positions.size(), no_entry);
        entry_.resize(part_.positions.size());
        result_.pairs.reserve(uses.size() / 2 + uses.size() / 16);
        for (Index low = 0; low < own_; ++low) {
            edges_.clear();
            const Index begin = low == 0 ? 0 : start[low - 1];
            const std::span<const Use> around = std::span(uses).subspan(begin, start[low] - begin);
            for (const Use& use : around) {
                if (seen_from[use.high] != low) {
                    seen_from[use.high] = low;
                    entry_[use.high] = static_cast<Index>(edges_.size());
                    edges_.push_back({use.high, use.side});
                } else if (Edge& edge = edges_[entry_[use.high]]; ++edge.uses == 2) {
                    edge.second_side = use.side;
                }
            }
            add_edges(low, around);
        }
    }

    void add_edges(Index low, std::span<const Use> uses) {
        bool crowded = false, has_links = false;
        for (const Edge& edge : edges_) {
            if (edge.uses == 1) add_plane_on(low, edge.high, edge.side, boundary_weight);
            if (edge.uses == 2) hold_seam(low, edge);
            crowded |= edge.uses > 2;
            if (edge.high >= own_) continue;
            result_.pairs.push_back({low, edge.high});
            has_links |= !live_.is_simple(low) || !live_.is_simple(edge.high);
        }
        for (const Use& use : uses)
            if (crowded && edges_[entry_[use.high]].uses > 2) add_plane_on(low, use.high, use.side, boundary_weight);
        add_outer_edges(low, uses);
        if (live_.several.empty()) return;
        result_.links_of_pairs.resize(result_.pairs.size());
        if (has_links) add_links(low, uses);
    }

    // The leaf at the slot, of the two that a side has.
    Index leaf_at(Index s, Index side) const {
        const Triangle& t = part_.triangles[side / 3];
        const Index first = t[side % 3];
        return slot(first) == s ? first : t[(side + 1) % 3];
    }

    void add_outer_edges(Index low, std::span<const Use> uses) {
        bool any = false;
        for (const Use& use : uses) {
            if (use.high < own_) continue;
            any = true;
            const Index far_leaf = part_.ghost_leaves[leaf_at(use.high, use.side) - part_.own_leaves];
            const Contraction::OuterEdge edge{low, far_leaf, components_of(leaf_at(low, use.side))};
            if (result_.outer_edges.empty() || result_.outer_edges.back() != edge) result_.outer_edges.push_back(edge);
        }
        if (!any) return;
        const auto own_leaves = std::span(part_.slot_of_leaf).first(part_.own_leaves);
        for (auto at = std::ranges::lower_bound(own_leaves, low); at != own_leaves.end() && *at == low; ++at) {
            const Index leaf = static_cast<Index>(at - own_leaves.begin());
            result_.border_leaves.push_back({part_.first_leaf + leaf, low, components_of(leaf)});
        }
    }

    // Of the pairs of a lower slot, which are the last ones.
    void add_links(Index low, std::span<const Use> uses) {
        found_links_.clear();
        for (const Use& use : uses) {
            if (use.high >= own_ || (live_.is_simple(low) && live_.is_simple(use.high))) continue;
            const LeafComponents a = components_of(leaf_at(low, use.side)),
                                 b = components_of(leaf_at(use.high, use.side));
            for (std::size_t c = 0; c < classes_.count; ++c) found_links_.push_back({use.high, {a[c], b[c]}});
        }
        std::sort(found_links_.begin(), found_links_.end());
        found_links_.erase(std::unique(found_links_.begin(), found_links_.end()), found_links_.end());
        for (std::size_t i = result_.pairs.size(); i-- > 0 && result_.pairs[i].a == low;) {
            const Index high = result_.pairs[i].b;
            LinkRange& range = result_.links_of_pairs[i];
            range.first = static_cast<Index>(result_.links.size());
            for (auto at = std::lower_bound(found_links_.begin(), found_links_.end(), FoundLink{high, {0, 0}});
                 at != found_links_.end() && at->high == high; ++at)
                result_.links.push_back(at->link);
            range.count = static_cast<Index>(result_.links.size()) - range.first;
        }
    }

    // A plane through the edge, at a right angle to its triangle.
    void add_plane_on(Index low, Index high, Index side, double edge_weight) {
        const Triangle& t = part_.triangles[side / 3];
        const glm::dvec3 p = corner(t[side % 3]), edge = corner(t[(side + 1) % 3]) - p,
                         inner = corner(t[(side + 2) % 3]) - p;
        const double squared = glm::dot(edge, edge);
        const glm::dvec3 normal = inner - edge * (glm::dot(inner, edge) / squared);
        const double length = glm::length(normal);
        if (!(length > 0) || !(squared > 0)) return;
        const glm::vec3 n(normal / length);
        const float strength = static_cast<float>(edge_weight * squared / 2 * part_.area_scale);
        for (const Index s : {low, high})
            if (s < own_) add_plane(quadric_of(s), strength, n);
    }

    // Two triangles that meet at an edge with different attributes there.
    void hold_seam(Index low, const Edge& edge) {
        if (part_.uv_class == most_classes && part_.slot_of_leaf.size() == part_.positions.size()) return; // no seams
        const Index t0 = leaf_at(low, edge.side), t1 = leaf_at(edge.high, edge.side);
        const Index u0 = leaf_at(low, edge.second_side), u1 = leaf_at(edge.high, edge.second_side);
        double weight = 0;
        if (t0 != u0 || t1 != u1) {
            if (!part_.materials.empty() && part_.materials[t0] != part_.materials[u0]) weight = material_weight;
            if (part_.uv_class < most_classes) weight = std::max(weight, uv_seam_weight * tear(t0, u0, t1, u1));
            if (const std::size_t c = part_.normal_class; c < most_classes)
                weight = std::max(weight, hard_edge_weight * (turn(t0, u0, c) + turn(t1, u1, c)) / 2);
        }
        if (part_.uv_class < most_classes && uv_orientation(edge.side) * uv_orientation(edge.second_side) < 0)
            weight = std::max(weight, uv_seam_weight); // mirrored charts share their coordinates there
        if (!(weight > 0)) return;
        for (const Index side : {edge.side, edge.second_side}) add_plane_on(low, edge.high, side, weight);
    }

    // How far the coordinates of both sides are apart at an edge's two ends, against how far they run along it, squared and
    // at most 1: at a pole whose triangles have coordinates of their own, the image is turned rather than torn.
    double tear(Index t0, Index u0, Index t1, Index u1) const {
        const std::size_t c = part_.uv_class;
        const auto squared = [&](Index leaf, Index other) {
            const float *a = values(leaf, c), *b = values(other, c);
            const double x = static_cast<double>(a[0]) - b[0], y = static_cast<double>(a[1]) - b[1];
            return x * x + y * y;
        };
        const double apart = std::max(squared(t0, u0), squared(t1, u1)),
                     along = std::max(squared(t0, t1), squared(u0, u1));
        return apart > 0 ? std::min(1.0, apart / along) : 0; // along may be 0
    }

    // 1 less the cosine between two leaves' normals.
    double turn(Index leaf, Index other, std::size_t c) const {
        const float *n = values(leaf, c), *m = values(other, c);
        if (std::equal(n, n + 3, m)) return 0;
        const double squared = static_cast<double>(part_.normal_scale) * part_.normal_scale;
        return std::max(0.0, 1 - (n[0] * m[0] + n[1] * m[1] + n[2] * m[2]) / squared);
    }

    // The sign of a triangle's area in the texture.
    int uv_orientation(Index side) const {
        const Triangle& t = part_.triangles[side / 3];
        const float *a = values(t[0], part_.uv_class), *b = values(t[1], part_.uv_class),
                    *c = values(t[2], part_.uv_class);
        const float area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        return area > 0 ? 1 : area < 0 ? -1 : 0;
    }

    struct FoundLink {
        Index high;
        Link link;
        auto operator<=>(const FoundLink&) const = default;
    };

    const PartMesh& part_;
    Index own_;
    AttributeClasses classes_;
    std::size_t channels_, stride_;
    std::vector<Index> component_of_leaf_; // by own leaf and class: number in the cluster; empty if all have one leaf
    std::vector<Index> by_value_, entry_;
    std::vector<Edge> edges_; // of one slot
    std::vector<FoundLink> found_links_;
    Contraction result_;
    LiveClusters& live_;
};

} // namespace

Contraction set_up(const PartMesh& part) { return PartSetup(part).run(); }

} // namespace unseen::vdtree
