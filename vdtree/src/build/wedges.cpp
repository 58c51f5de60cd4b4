#include "build/wedges.h"

#include <atomic>
#include <deque>
#include <memory>
#include <numeric>
#include <tuple>

#include <glm/geometric.hpp>

#include "build/attribute_scales.h"
#include "build/parallel_array.h"
#include "build/spatial_order.h"
#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

namespace {

// Wedges whose triangles have all vanished by the time that their node was made are drawn in mixed cuts only. They are
// united with the nearest wedge of their material if it is this near (shares of the extent, by the scales above), or
// while a node has more wedges than this. At four, texture stretches in mixed cuts begin to show.
constexpr double near_enough = 0.02;
constexpr std::size_t most_wedges_with_dead = 8;
// Above this many, neighbours in order stand in for the nearest: looking at all pairs takes the square of the time.
constexpr std::size_t most_compared = 64;

constexpr std::size_t most_classes = 4;
enum class Kind { normal, uv, colour, further };

// What one class has on all triangles at a wedge: for each channel s = g.p + d on a triangle, the sums of w g and w d.
// A channel is a lane.
struct Component {
    Double4 x{}, y{}, z{}, d{};
    double weight = 0;

    void operator+=(const Component& other) {
        x += other.x, y += other.y, z += other.z, d += other.d;
        weight += other.weight;
    }
    glm::dvec4 value_at(const glm::dvec3& p) const {
        const Double4 value = (x * p.x + y * p.y + z * p.z + d) / weight;
        return {value[0], value[1], value[2], value[3]};
    }
};

// The same at a leaf, through its place and its value.
struct LeafSlopes {
    Float4 x{}, y{}, z{};
    float weight = 0;
};

struct Class {
    Kind kind;
    float
        scale; // to lengths in the unit box: weighs triangles on which a value changes fast, and says which wedges are alike
};

// A wedge of the node at hand. Its leaves are known by one of them, the root of a union.
struct WedgeState {
    Index root = 0;
    Index material = 0;
    Index last = 0; // when the last of its triangles vanishes, in the order in which the clusterer made the nodes
    std::array<Index, most_classes> component{};
};

struct NodeState {
    std::vector<WedgeState> wedges;
    std::vector<Component> components;

    void clear() {
        wedges.clear();
        components.clear();
    }
};

struct WedgeValues {
    std::array<glm::dvec4, most_classes> of;
};

// States of nodes whose parents are still to come, and the values that have been found. One for each task; what a
// parent has taken is used again.
struct Workspace {
    // Class by class, of the leaves that hang on the task's nodes: a run of leaves, or, above the parts, these.
    std::vector<LeafSlopes> slopes;
    Index first_leaf = 0;
    bool is_top = false;
    std::vector<Index> top_leaves; // ascending
    std::deque<NodeState> states;
    std::vector<NodeState*> unused;
    std::vector<WedgeValues> values;
    NodeState compacted;
    std::vector<Index> number;           // by wedge or component of a node, for a while
    std::vector<Index> into;             // by wedge of the children: the wedge that it became, by its first one
    std::vector<Index> component_parent; // by component: itself, or one that it was united with

    NodeState* take() {
        if (unused.empty()) return &states.emplace_back();
        NodeState* state = unused.back();
        unused.pop_back();
        state->clear();
        return state;
    }
};

// Filled once.
class RankSet {
public:
    explicit RankSet(Index size) : words_(size / 32 + 1) {}
    void insert(Index i) { words_[i / 32].bits |= 1u << (i % 32); }
    std::vector<RankWord> take() {
        Index before = 0;
        for (RankWord& word : words_) {
            word.before = before;
            before += static_cast<Index>(std::popcount(word.bits));
        }
        return std::move(words_);
    }

private:
    std::vector<RankWord> words_;
};

class WedgeFinder {
public:
    WedgeFinder(const TreeShape& shape, const TreeParts& parts, std::span<const glm::vec3> positions,
                const LeafMesh& mesh, const Ancestors& ancestors)
        : shape_(shape), parts_(parts), positions_(positions), mesh_(mesh), interior_(shape.interior()),
          splits_(!mesh.first_leaf.empty() || !mesh.materials.empty()) {
        list_places();
        measure();
        if (splits_) find_meetings(ancestors);
        states_.assign(interior_, nullptr);
        spaces_.resize(parts.count());
    }

    NodeWedges run() {
        if (!splits_) {
            make_room(interior_ + shape_.leaves());
            for_each_node([this](NodeId node, Workspace& space, std::uint16_t) { visit_whole(node, space); });
        } else {
            counts_.assign(interior_, 1);
            values_at_.resize(interior_);
            for_each_node([this](NodeId node, Workspace& space, std::uint16_t number) { visit(node, space, number); });
            number_wedges();
        }
        fill();
        return std::move(out_);
    }

private:
    // ---- what is measured of the mesh

    void measure() {
        const Box box = box_around(positions_.subspan(interior_), [](const glm::vec3& p) { return glm::dvec3(p); });
        const double extent = box.extent();
        centre_ = box.low + box.size() * 0.5;
        scale_ = extent > 0 && std::isfinite(1 / extent) ? 1 / extent : 1;
        float_scale_ = static_cast<float>(scale_);
        unit_places_.resize(shape_.leaves());
        parallel_loop(Index{0}, shape_.leaves(),
                      [&](Index place) { unit_places_[place] = unit_position(interior_ + place); });
        const auto add_class = [&](Kind kind, double scale) { classes_.push_back({kind, static_cast<float>(scale)}); };
        add_class(Kind::normal, normal_scale);
        if (!mesh_.uvs.empty())
            add_class(Kind::uv,
                      texture_scale * texture_density(mesh_.triangles, mesh_.uvs,
                                                      [&](Index leaf) -> const glm::dvec3& { return place_of(leaf); }));
        if (!mesh_.colours.empty()) add_class(Kind::colour, colour_scale);
        if (!mesh_.further.empty()) add_class(Kind::further, 0); // without a value at proxies
    }

    Index first_leaf(Index place) const { return mesh_.first_leaf.empty() ? place : mesh_.first_leaf[place]; }
    Index leaf_count() const { return first_leaf(shape_.leaves()); }
    glm::dvec3 unit_position(NodeId node) const { return (glm::dvec3(positions_[node]) - centre_) * scale_; }
    const glm::dvec3& place_of(Index leaf) const { return unit_places_[place_node(leaf) - interior_]; }
    NodeId place_node(Index leaf) const { return interior_ + (places_.empty() ? leaf : places_[leaf]); }

    UNSEEN_INLINE Float4 value_of(Kind kind, Index leaf) const {
        const auto channels = [](const auto&... values) { return Float4{static_cast<float>(values)...}; };
        switch (kind) {
        case Kind::normal: return channels(mesh_.normals[leaf].x, mesh_.normals[leaf].y, mesh_.normals[leaf].z);
        case Kind::uv: return channels(mesh_.uvs[leaf].x, mesh_.uvs[leaf].y);
        case Kind::further: return channels(mesh_.further[leaf]);
        case Kind::colour: break;
        }
        const glm::vec4& colour = mesh_.colours[leaf];
        return channels(colour.r, colour.g, colour.b, colour.a);
    }
    bool has_same_value(Kind kind, Index leaf, Index other) const {
        const Float4 a = value_of(kind, leaf), b = value_of(kind, other);
        return a[0] == b[0] && a[1] == b[1] && a[2] == b[2] && a[3] == b[3];
    }

    void list_places() {
        if (mesh_.first_leaf.empty()) return;
        places_.resize(leaf_count());
        for (Index place = 0; place < shape_.leaves(); ++place)
            for (Index leaf = first_leaf(place); leaf < first_leaf(place + 1); ++leaf) places_[leaf] = place;
    }

    // Where triangles vanish with two corners, and where the third one joins these.
    void find_meetings(const Ancestors& ancestors) {
        const std::size_t triangles = mesh_.triangles.size();
        root_.resize(leaf_count());
        std::iota(root_.begin(), root_.end(), Index{0});
        local_.assign(leaf_count(), 0);
        last_.assign(leaf_count(), 0);
        ParallelArray<NodeId> joins(triangles, Unfilled());
        parallel_loop(NodeId{0}, interior_, [&](NodeId vanishing) {
            for (Index t = mesh_.first_triangle[vanishing]; t < mesh_.first_triangle[vanishing + 1]; ++t) {
                const auto place = [&](std::size_t k) { return place_node(mesh_.triangles[t][k]) - interior_; };
                const std::pair<Index, Index> ends = std::minmax({place(0), place(1), place(2)});
                const NodeId whole = ancestors.lowest(vanishing, [&](NodeId node) {
                    return shape_.first_leaf[node] <= ends.first && ends.second < shape_.leaf_end[node];
                });
                joins[t] = whole == vanishing ? no_node : whole;
            }
        });
        first_join_.assign(std::size_t{interior_} + 1, 0);
        for (Index t = 0; t < triangles; ++t)
            if (joins[t] != no_node) ++first_join_[joins[t] + 1];
        std::partial_sum(first_join_.begin(), first_join_.end(), first_join_.begin());
        joining_.resize(first_join_.back());
        std::vector<Index> next(first_join_.begin(), first_join_.end() - 1);
        for (Index t = 0; t < triangles; ++t)
            if (joins[t] != no_node) joining_[next[joins[t]]++] = t;
        for (NodeId node = 0; node < interior_; ++node)
            for (Index t = mesh_.first_triangle[node]; t < mesh_.first_triangle[node + 1]; ++t)
                for (const Index leaf : mesh_.triangles[t]) last_[leaf] = std::max(last_[leaf], shape_.made[node]);
        parents_below_.resize(interior_);
    }

    // ---- node by node, children first

    // Calls visit(node, space, the space's number).
    template <class Visit>
    void for_each_node(Visit&& visit) {
        parts_.bottom_up([&](const TreePart& part) {
            const auto number = static_cast<std::uint16_t>(used_spaces_++);
            spaces_[number] = std::make_unique<Workspace>();
            measure_leaves(part, *spaces_[number]);
            return [&visit, &space = *spaces_[number], number](NodeId node) { visit(node, space, number); };
        });
    }

    // In a tree without seams: a node has one wedge, of its number.
    void visit_whole(NodeId node, Workspace& space) {
        NodeState* state = nullptr;
        shape_.for_each_child(
            node,
            [&](NodeId child) {
                if (!state) {
                    state = states_[child];
                } else {
                    for (std::size_t c = 0; c < classes_.size(); ++c)
                        state->components[c] += states_[child]->components[c];
                    space.unused.push_back(states_[child]);
                }
            },
            [&](Index place) {
                if (!state) {
                    state = space.take();
                    state->components.resize(classes_.size());
                }
                for (std::size_t c = 0; c < classes_.size(); ++c) state->components[c] += component_of(c, place, space);
            });
        const glm::dvec3 at = unit_position(node);
        for (std::size_t c = 0; c < classes_.size(); ++c)
            put(node, classes_[c].kind, state->components[c].value_at(at));
        states_[node] = state;
    }

    void visit(NodeId node, Workspace& space, std::uint16_t number) {
        NodeState& state = *space.take();
        shape_.for_each_child(
            node,
            [&](NodeId child) {
                append(*states_[child], state);
                space.unused.push_back(std::exchange(states_[child], nullptr));
            },
            [&](Index place) { add_place(place, state, space); });
        unite_wedges(node, state, space);
        values_at_[node] = {static_cast<Index>(space.values.size()), number};
        for (const WedgeState& wedge : state.wedges)
            space.values.push_back(values_of(wedge, state, unit_position(node)));
        counts_[node] = static_cast<Index>(state.wedges.size());
        states_[node] = &state;
    }

    void append(NodeState& child, NodeState& to) const {
        if (to.wedges.empty()) {
            to.wedges.swap(child.wedges);
            to.components.swap(child.components);
            return;
        }
        const Index before = static_cast<Index>(to.components.size());
        to.components.insert(to.components.end(), child.components.begin(), child.components.end());
        for (WedgeState wedge : child.wedges) {
            for (Index& component : wedge.component) component += before;
            to.wedges.push_back(wedge);
        }
    }

    void add_place(Index place, NodeState& to, Workspace& space) const {
        const std::size_t first_wedge = to.wedges.size();
        for (Index leaf = first_leaf(place); leaf < first_leaf(place + 1); ++leaf) {
            WedgeState wedge;
            wedge.root = leaf;
            if (!mesh_.materials.empty()) wedge.material = mesh_.materials[leaf];
            wedge.last = last_[leaf];
            for (std::size_t c = 0; c < classes_.size(); ++c) {
                Index& component = wedge.component[c];
                component = shared_component(classes_[c], c, wedge, std::span(to.wedges).subspan(first_wedge));
                if (component == none) {
                    component = static_cast<Index>(to.components.size());
                    to.components.push_back(component_of(c, leaf, space));
                } else {
                    to.components[component] += component_of(c, leaf, space);
                }
            }
            to.wedges.push_back(wedge);
        }
    }

    // That of another leaf at the place with the same value. Textures are shared within a material only.
    Index shared_component(const Class& of, std::size_t c, const WedgeState& wedge,
                           std::span<const WedgeState> others) const {
        // Looking at all pairs would take the square of the time where thousands of leaves meet.
        const std::size_t looked_at = std::min(others.size(), most_compared);
        for (const WedgeState& other : others.last(looked_at))
            if (has_same_value(of.kind, other.root, wedge.root) &&
                (of.kind != Kind::uv || other.material == wedge.material))
                return other.component[c];
        return none;
    }

    // Where what the classes have on the triangles at a leaf begins; none: the leaf hangs on no node of the task.
    UNSEEN_INLINE LeafSlopes* slopes_of(Index leaf, Workspace& space) const {
        std::size_t at = leaf - space.first_leaf;
        if (space.is_top) {
            const auto found = std::ranges::lower_bound(space.top_leaves, leaf);
            if (found == space.top_leaves.end() || *found != leaf) return nullptr;
            at = static_cast<std::size_t>(found - space.top_leaves.begin());
        }
        at *= classes_.size();
        return at < space.slopes.size() ? &space.slopes[at] : nullptr;
    }

    // Leaves on nothing but slivers have their own value.
    Component component_of(std::size_t c, Index leaf, Workspace& space) const {
        constexpr double least_weight = 1e-30;
        const LeafSlopes& slopes = slopes_of(leaf, space)[c];
        const glm::dvec3& at = place_of(leaf);
        Component out;
        out.x = __builtin_convertvector(slopes.x, Double4);
        out.y = __builtin_convertvector(slopes.y, Double4);
        out.z = __builtin_convertvector(slopes.z, Double4);
        out.weight = slopes.weight > 0 ? static_cast<double>(slopes.weight) : least_weight;
        out.d = out.weight * __builtin_convertvector(value_of(classes_[c].kind, leaf), Double4) -
                (out.x * at.x + out.y * at.y + out.z * at.z);
        return out;
    }

    void measure_leaves(const TreePart& part, Workspace& space) const {
        std::vector<Index>& top = space.top_leaves;
        space.is_top = parts_.is_top(part);
        space.first_leaf = first_leaf(part.first_leaf);
        std::size_t count = first_leaf(part.leaf_end) - space.first_leaf;
        if (space.is_top) {
            const auto is_own = [&](Index leaf) { return parts_.owns_leaf(part, place_node(leaf) - interior_); };
            for (const Index t : part.crossing)
                std::ranges::copy_if(mesh_.triangles[t], std::back_inserter(top), is_own);
            std::sort(top.begin(), top.end());
            top.erase(std::unique(top.begin(), top.end()), top.end());
            count = top.size();
        }
        space.slopes.resize(count * classes_.size());
        TreeParts::for_each_triangle(part, [&](Index t) { add_triangle(mesh_.triangles[t], space); });
    }

    // The linear functions that the classes have on a triangle.
    void add_triangle(const Triangle& t, Workspace& space) const {
        const glm::vec3 p = positions_[place_node(t[0])], e = (positions_[place_node(t[1])] - p) * float_scale_,
                        f = (positions_[place_node(t[2])] - p) * float_scale_, cross = glm::cross(e, f);
        const float squared = glm::dot(cross, cross), inverse = 1 / squared, area = std::sqrt(squared) / 6;
        if (!(squared >= std::numeric_limits<float>::min())) return; // floats do not know its normal
        const glm::vec3 by_e = glm::cross(f, cross) * inverse, by_f = glm::cross(cross, e) * inverse;
        const std::array at{slopes_of(t[0], space), slopes_of(t[1], space), slopes_of(t[2], space)};
        for (std::size_t c = 0; c < classes_.size(); ++c) {
            const auto [kind, scale] = classes_[c];
            if (kind == Kind::further) continue;
            const Float4 s = value_of(kind, t[0]), along_e = value_of(kind, t[1]) - s,
                         along_f = value_of(kind, t[2]) - s;
            const Float4 x = along_e * by_e.x + along_f * by_f.x, y = along_e * by_e.y + along_f * by_f.y,
                         z = along_e * by_e.z + along_f * by_f.z, slope = x * x + y * y + z * z;
            const float steepest = std::max(std::max(slope[0], slope[1]), std::max(slope[2], slope[3]));
            const float w = area / (1 + steepest * scale * scale);
            const bool is_bounded = slope[0] + slope[1] + slope[2] + slope[3] < std::numeric_limits<float>::max();
            if (!is_bounded || !(w > 0)) continue; // NaN is not, either
            for (LeafSlopes* corner : at) {
                if (!corner) continue;
                corner[c].x += w * x, corner[c].y += w * y, corner[c].z += w * z;
                corner[c].weight += w;
            }
        }
    }

    // Unions of leaves; parts do not touch each other's.
    Index find(Index leaf) {
        while (root_[leaf] != leaf) leaf = root_[leaf] = root_[root_[leaf]];
        return leaf;
    }

    void unite_wedges(NodeId node, NodeState& state, Workspace& space) {
        auto& wedges = state.wedges;
        space.into.resize(wedges.size());
        std::iota(space.into.begin(), space.into.end(), Index{0});
        space.component_parent.resize(state.components.size());
        std::iota(space.component_parent.begin(), space.component_parent.end(), Index{0});
        for (Index w = 0; w < wedges.size(); ++w) local_[wedges[w].root] = w;
        const Index begin = first_leaf(shape_.first_leaf[node]), size = first_leaf(shape_.leaf_end[node]) - begin;
        const auto join_corners = [&](const Triangle& t) {
            for (std::size_t k = 0; k < 3; ++k) {
                const Index a = t[k], b = t[(k + 1) % 3];
                if (a - begin < size && b - begin < size) join(local_[find(a)], local_[find(b)], state, space);
            }
        };
        for (Index t = mesh_.first_triangle[node]; t < mesh_.first_triangle[node + 1]; ++t)
            join_corners(mesh_.triangles[t]);
        for (Index i = first_join_[node]; i < first_join_[node + 1]; ++i) join_corners(mesh_.triangles[joining_[i]]);
        if (std::ranges::count_if(wedges, [&](const WedgeState& w) { return find(w.root) == w.root; }) > 1) {
            join_equal(state, space);
            join_dead(node, state, space);
        }
        compact(node, state, space);
    }

    static Index top(std::vector<Index>& parents, Index i) {
        while (parents[i] != i) i = parents[i] = parents[parents[i]];
        return i;
    }

    // The earlier of two stands for both.
    void join(Index a, Index b, NodeState& state, Workspace& space) {
        a = top(space.into, a), b = top(space.into, b);
        if (a == b) return;
        if (b < a) std::swap(a, b);
        WedgeState &to = state.wedges[a], &from = state.wedges[b];
        space.into[b] = a;
        root_[from.root] = to.root;
        to.last = std::max(to.last, from.last);
        for (std::size_t c = 0; c < classes_.size(); ++c) {
            const Index x = top(space.component_parent, to.component[c]),
                        y = top(space.component_parent, from.component[c]);
            if (x == y) continue;
            state.components[std::min(x, y)] += state.components[std::max(x, y)];
            space.component_parent[std::max(x, y)] = std::min(x, y);
        }
    }

    template <class F>
    void for_each_wedge(const NodeState& state, const Workspace& space, F&& f) const {
        for (Index w = 0; w < state.wedges.size(); ++w)
            if (space.into[w] == w) f(w);
    }

    // Those of one material that share the values of all classes.
    void join_equal(NodeState& state, Workspace& space) {
        std::vector<std::tuple<Index, std::array<Index, most_classes>, Index>> order;
        for_each_wedge(state, space, [&](Index w) {
            auto components = state.wedges[w].component;
            for (std::size_t c = 0; c < classes_.size(); ++c)
                components[c] = top(space.component_parent, components[c]);
            order.emplace_back(state.wedges[w].material, components, w);
        });
        if (order.size() < 2) return;
        std::ranges::sort(order);
        for (std::size_t i = 1; i < order.size(); ++i) {
            const auto& [material, components, w] = order[i];
            const auto& [material_before, components_before, before] = order[i - 1];
            if (material == material_before && components == components_before) join(before, w, state, space);
        }
    }

    void join_dead(NodeId node, NodeState& state, Workspace& space) {
        std::vector<Index> left;
        const auto list = [&] {
            left.clear();
            for_each_wedge(state, space, [&](Index w) { left.push_back(w); });
        };
        list();
        const auto is_dead = [&](Index w) { return state.wedges[w].last <= shape_.made[node]; };
        if (std::ranges::none_of(left, is_dead)) return;
        const glm::dvec3 at = unit_position(node);
        if (left.size() > most_compared) {
            thin_out(left, at, is_dead, state, space);
            list();
        }
        std::vector<WedgeValues> values;
        for (const Index w : left) values.push_back(values_of(state.wedges[w], state, at, space));
        for (bool again = true; again && left.size() > 1;) {
            again = false;
            Nearest nearest;
            for (std::size_t i = 0; i < left.size(); ++i)
                for (std::size_t j = 0; j < left.size(); ++j)
                    if (i != j && is_dead(left[i])) nearest.propose(i, j, apart(state, left, values, i, j));
            if (!(nearest.distance < near_enough) &&
                (left.size() <= most_wedges_with_dead || !std::isfinite(nearest.distance)))
                return;
            const std::size_t keep = std::min(nearest.i, nearest.j), go = std::max(nearest.i, nearest.j);
            join(left[keep], left[go], state, space);
            left.erase(left.begin() + static_cast<std::ptrdiff_t>(go));
            values.erase(values.begin() + static_cast<std::ptrdiff_t>(go));
            values[keep] = values_of(state.wedges[left[keep]], state, at, space);
            again = true;
        }
    }

    struct Nearest {
        std::size_t i = 0, j = 0;
        double distance = std::numeric_limits<double>::infinity();
        void propose(std::size_t a, std::size_t b, double d) {
            if (d < distance) *this = {a, b, d};
        }
    };

    double apart(const NodeState& state, std::span<const Index> which, std::span<const WedgeValues> values,
                 std::size_t i, std::size_t j) const {
        if (state.wedges[which[i]].material != state.wedges[which[j]].material)
            return std::numeric_limits<double>::infinity();
        double squared = 0;
        for (std::size_t c = 0; c < classes_.size(); ++c) {
            const glm::dvec4 difference = (values[i].of[c] - values[j].of[c]) * static_cast<double>(classes_[c].scale);
            squared += glm::dot(difference, difference);
        }
        return std::sqrt(squared);
    }

    // Unites dead wedges with their neighbours in the order of their values.
    template <class IsDead>
    void thin_out(std::span<const Index> wedges, const glm::dvec3& at, IsDead&& is_dead, NodeState& state,
                  Workspace& space) {
        std::vector<std::tuple<Index, double, double, Index>> order; // material, two of the values, wedge
        const std::size_t c = classes_.size() > 1 ? 1 : 0;
        for (const Index w : wedges) {
            const glm::dvec4 value = values_of(state.wedges[w], state, at, space).of[c];
            order.emplace_back(state.wedges[w].material, value.x, value.y, w);
        }
        std::ranges::sort(order);
        std::size_t left = order.size();
        for (std::size_t i = 1; i < order.size() && left > most_compared; ++i) {
            const Index before = std::get<3>(order[i - 1]), w = std::get<3>(order[i]);
            if (std::get<0>(order[i]) != std::get<0>(order[i - 1]) || (!is_dead(w) && !is_dead(before))) continue;
            join(before, w, state, space);
            --left;
        }
    }

    // Numbers what is left, and notes which wedge each child's has become.
    void compact(NodeId node, NodeState& state, Workspace& space) {
        auto& number = space.number;
        number.assign(state.wedges.size(), none);
        Index kept = 0;
        for_each_wedge(state, space, [&](Index w) { number[w] = kept++; });
        if (kept > 1) {
            auto below = std::make_unique<Index[]>(state.wedges.size());
            for (Index w = 0; w < state.wedges.size(); ++w) below[w] = number[top(space.into, w)];
            parents_below_[node] = std::move(below);
        }
        number.assign(state.components.size(), none);
        auto& wedges = space.compacted.wedges;
        auto& components = space.compacted.components;
        space.compacted.clear();
        for_each_wedge(state, space, [&](Index w) {
            WedgeState& wedge = wedges.emplace_back(state.wedges[w]);
            for (std::size_t c = 0; c < classes_.size(); ++c) {
                const Index from = top(space.component_parent, wedge.component[c]);
                if (number[from] == none) {
                    number[from] = static_cast<Index>(components.size());
                    components.push_back(state.components[from]);
                }
                wedge.component[c] = number[from];
            }
        });
        state.wedges.swap(wedges);
        state.components.swap(components);
    }

    WedgeValues values_of(const WedgeState& wedge, const NodeState& state, const glm::dvec3& at) const {
        WedgeValues values{};
        for (std::size_t c = 0; c < classes_.size(); ++c)
            values.of[c] = state.components[wedge.component[c]].value_at(at);
        return values;
    }
    WedgeValues values_of(WedgeState wedge, const NodeState& state, const glm::dvec3& at, Workspace& space) const {
        for (std::size_t c = 0; c < classes_.size(); ++c)
            wedge.component[c] = top(space.component_parent, wedge.component[c]);
        return values_of(wedge, state, at);
    }

    // ---- numbers

    bool has_seams() const {
        return !mesh_.first_leaf.empty() || std::ranges::any_of(counts_, [](Index count) { return count > 1; });
    }

    // Calls f(wedge of a child, wedge of the node) by the numbers before sorting, children in depth-first order.
    template <class F>
    void for_each_link(NodeId node, std::span<const WedgeId> first, F&& f) const {
        const Index* below = counts_[node] > 1 ? parents_below_[node].get() : nullptr;
        std::size_t i = 0;
        const auto link = [&](NodeId child) {
            for (WedgeId w = first[child]; w < first[child + 1]; ++w, ++i) f(w, first[node] + (below ? below[i] : 0));
        };
        shape_.for_each_child(node, link, [&](Index place) { link(interior_ + place); });
    }

    // Ranks follow the forest depth-first; then each node's wedges are put in the order of their ranks.
    void number_wedges() {
        const NodeId nodes = interior_ + shape_.leaves();
        auto& first = first_wedge_;
        if (!has_seams()) return make_room(nodes);
        first.assign(std::size_t{nodes} + 1, 0);
        for (NodeId node = 0; node < interior_; ++node) first[node + 1] = first[node] + counts_[node];
        for (Index place = 0; place < shape_.leaves(); ++place)
            first[interior_ + place + 1] = first[interior_] + first_leaf(place + 1);
        const WedgeId wedges = first[nodes];
        make_room(wedges);
        std::vector<Index> sizes(wedges, 0), next(wedges, 0), ranks(wedges, 0);
        std::fill(sizes.begin() + first[interior_], sizes.end(), Index{1});
        for (NodeId node = interior_; node-- > 0;)
            for_each_link(node, first, [&](WedgeId below, WedgeId above) { sizes[above] += sizes[below]; });
        for (WedgeId w = first[0] + 1; w < first[1]; ++w) ranks[w] = ranks[w - 1] + sizes[w - 1];
        for (NodeId node = 0; node < interior_; ++node) {
            for (WedgeId w = first[node]; w < first[node + 1]; ++w) next[w] = ranks[w];
            for_each_link(node, first, [&](WedgeId below, WedgeId above) {
                ranks[below] = next[above];
                next[above] += sizes[below];
            });
        }
        by_rank_.resize(wedges);
        std::iota(by_rank_.begin(), by_rank_.end(), WedgeId{0});
        for (NodeId node = 0; node < nodes; ++node)
            std::sort(by_rank_.begin() + first[node], by_rank_.begin() + first[node + 1],
                      [&](WedgeId a, WedgeId b) { return ranks[a] < ranks[b]; });
        out_.leaf_numbers.resize(leaf_count());
        for (Index leaf = 0; leaf < leaf_count(); ++leaf)
            out_.leaf_numbers[by_rank_[first[interior_] + leaf] - first[interior_]] = leaf;
        pack_links(ranks);
    }

    // `ranks`: by wedge before sorting.
    void pack_links(std::span<const Index> ranks) {
        const NodeId nodes = interior_ + shape_.leaves();
        auto& links = out_.links;
        const auto& first = first_wedge_;
        RankSet several(nodes), further(first[nodes]);
        links.extra_wedges.push_back(0);
        for (NodeId node = 0; node < nodes; ++node) {
            const Index count = first[node + 1] - first[node];
            for (Index i = 1; i < count; ++i) further.insert(first[node] + i);
            for (Index i = 0; i < count && count > 1 && node < interior_; ++i)
                links.wedge_ranks.push_back(ranks[by_rank_[first[node] + i]]);
            if (count == 1) continue;
            several.insert(node);
            links.extra_wedges.push_back(links.extra_wedges.back() + count - 1);
        }
        for (WedgeId w = first[interior_]; w < first[nodes]; ++w) links.leaf_ranks.push_back(ranks[by_rank_[w]]);
        links.several = several.take();
        links.further = further.take();
    }

    // ---- values

    void make_room(WedgeId wedges) {
        out_.positions.resize(wedges);
        out_.normals.resize(wedges);
        if (!mesh_.uvs.empty()) out_.uvs.resize(wedges);
        if (!mesh_.colours.empty()) out_.colours.resize(wedges);
    }

    void fill() {
        const NodeId nodes = interior_ + shape_.leaves();
        const auto first_wedge_of = [&](NodeId node) { return first_wedge_.empty() ? node : first_wedge_[node]; };
        const WedgeId leaves_begin = first_wedge_of(interior_);
        parallel_loop(NodeId{0}, nodes, [&](NodeId node) {
            const WedgeId begin = first_wedge_of(node), end = first_wedge_of(node + 1);
            for (WedgeId w = begin; w < end; ++w) {
                out_.positions[w] = positions_[node];
                const WedgeId given = by_rank_.empty() ? w : by_rank_[w];
                if (node >= interior_) put_leaf(w, given - leaves_begin);
                else if (splits_) put(w, values_at_[node], given - begin);
            }
        });
    }

    void put(WedgeId w, const std::pair<Index, std::uint16_t>& of_node, Index number) {
        const WedgeValues& values = spaces_[of_node.second]->values[of_node.first + number];
        for (std::size_t c = 0; c < classes_.size(); ++c) put(w, classes_[c].kind, values.of[c]);
    }
    void put(WedgeId w, Kind kind, const glm::dvec4& value) {
        switch (kind) {
        case Kind::normal: out_.normals[w] = PackedNormal::nearest(glm::vec3(value)); break;
        case Kind::uv: out_.uvs[w] = glm::vec2(value); break;
        case Kind::further: break;
        case Kind::colour: out_.colours[w] = glm::vec4(glm::clamp(value, 0.0, 1.0)); break;
        }
    }

    void put_leaf(WedgeId w, Index leaf) {
        out_.normals[w] = PackedNormal::nearest(mesh_.normals[leaf]);
        if (!mesh_.uvs.empty()) out_.uvs[w] = mesh_.uvs[leaf];
        if (!mesh_.colours.empty()) out_.colours[w] = mesh_.colours[leaf];
    }

    static constexpr Index none = 0xffffffffu;

    const TreeShape& shape_;
    const TreeParts& parts_;
    std::span<const glm::vec3> positions_;
    const LeafMesh& mesh_;
    NodeId interior_;
    bool splits_; // nodes may have several wedges
    glm::dvec3 centre_{0};
    double scale_ = 1; // mesh units to the unit box
    float float_scale_ = 1;
    std::vector<glm::dvec3> unit_places_; // by place
    std::vector<Class> classes_;

    std::vector<Index> places_;               // by leaf; empty: the same
    std::vector<Index> first_join_, joining_; // triangles by the node at which their third corner joins the others
    std::vector<Index> root_, local_, last_;  // by leaf

    std::atomic<std::size_t> used_spaces_ = 0;
    std::vector<std::unique_ptr<Workspace>> spaces_; // a part each
    std::vector<NodeState*> states_; // by interior node, and so on; of those whose parents are still to come
    std::vector<Index> counts_;
    std::vector<std::pair<Index, std::uint16_t>> values_at_; // where the values of its wedges begin, and in which space
    std::vector<std::unique_ptr<Index[]>> parents_below_;    // of several wedges: which of them each child's has become

    std::vector<WedgeId> first_wedge_; // by node, one longer; empty: the same
    std::vector<WedgeId> by_rank_;     // by wedge: its number before sorting; empty: the same
    NodeWedges out_;
};

} // namespace

NodeWedges find_wedges(const TreeShape& shape, const TreeParts& parts, std::span<const glm::vec3> positions,
                       const LeafMesh& mesh, const Ancestors& ancestors) {
    return WedgeFinder(shape, parts, positions, mesh, ancestors).run();
}

} // namespace unseen::vdtree
