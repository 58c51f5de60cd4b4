#include "measure/open_border.h"

#include <cmath>

#include "measure/measurement.h"

namespace unseen::perception {

using namespace vdtree;

namespace {

// An edge from a place.
struct Edge {
    Index to, opposite; // places: the other end, and the triangle's third corner
    Index triangle;
    unsigned number; // of the triangle's edges
};

void add_edges(Index from, Index triangle, const Triangle& at, std::vector<Edge>& edges) {
    for (unsigned k = 0; k < 3; ++k) {
        const unsigned next = (k + 1) % 3;
        if (at[k] == from) edges.push_back({at[next], at[(k + 2) % 3], triangle, k});
        if (at[next] == from) edges.push_back({at[k], at[(k + 2) % 3], triangle, k});
    }
}

// Marks those of an odd number of triangles; triangles with the same corners are one.
void mark_odd(std::vector<Edge>& edges, std::vector<std::uint8_t>& edges_of) {
    std::sort(edges.begin(), edges.end(),
              [](const Edge& a, const Edge& b) { return a.to != b.to ? a.to < b.to : a.opposite < b.opposite; });
    for (std::size_t begin = 0, next = 0; begin < edges.size(); begin = next) {
        bool is_odd = false;
        for (; next < edges.size() && edges[next].to == edges[begin].to; ++next)
            if (next == begin || edges[next].opposite != edges[next - 1].opposite) is_odd = !is_odd;
        for (std::size_t k = begin; k < next && is_odd; ++k)
            edges_of[edges[k].triangle] |= static_cast<std::uint8_t>(1u << edges[k].number);
    }
}

} // namespace

OpenBorder::OpenBorder(const SoundTree& tree, const PlaceTriangles& mesh) {
    if (!(tree.bounds()[VertexTree::root()].flags & irregular_ring)) return;
    find_edges(tree, mesh);
    collect_ends(tree, mesh);
    if (ends_.empty()) edges_of_ = {};
}

void OpenBorder::find_edges(const SoundTree& tree, const PlaceTriangles& mesh) {
    edges_of_.assign(tree.triangles().size(), 0);
    std::vector<Edge> edges;
    for (Index place = 0; place < tree.place_count(); ++place) {
        const NodeId above = tree.parents()[tree.interior_count() + place];
        if (!(tree.bounds()[above].flags & irregular_ring)) continue;
        edges.clear();
        for (const Index triangle : mesh.around(place)) add_edges(place, triangle, mesh.corners(triangle), edges);
        mark_odd(edges, edges_of_);
    }
}

void OpenBorder::collect_ends(const SoundTree& tree, const PlaceTriangles& mesh) {
    for (Index triangle = 0; triangle < tree.triangles().size(); ++triangle) {
        const Triangle& t = mesh.corners(triangle);
        for (unsigned k = 0; k < 3; ++k) {
            if (!((edges_of_[triangle] >> k) & 1)) continue;
            ends_.push_back({t[k], t[(k + 1) % 3], t[(k + 2) % 3]});
            ends_.push_back({t[(k + 1) % 3], t[k], t[(k + 2) % 3]});
        }
    }
    std::sort(ends_.begin(), ends_.end());
    first_end_.assign(std::size_t{tree.place_count()} + 1, 0);
    for (const End& end : ends_) ++first_end_[end.place + 1];
    for (std::size_t i = 1; i < first_end_.size(); ++i) first_end_[i] += first_end_[i - 1];
}

void BorderSide::take(const Segment& edge, const glm::vec3& inside, const glm::vec3& nearest, float squared) {
    if (squared < (1 - rounding) * squared_) squared_ = squared, nearest_ = nearest, inward_ = glm::vec3(0);
    // Which side it is, none of the edges that meet there tells alone.
    const glm::vec3 along = edge.b - edge.a, beside = inside - edge.a;
    const float length = glm::dot(along, along);
    const glm::vec3 across = length > 0 ? beside - glm::dot(beside, along) / length * along : beside;
    if (const float width = glm::length(across); width > 0) inward_ += across / width;
}

float BorderSide::distance() const { return std::sqrt(squared_); }

float BorderSide::outside() const { return glm::dot(point_ - nearest_, inward_) < 0 ? distance() : 0; }

float farthest_from(std::span<const Segment> segments, std::span<const glm::vec3> points) {
    float farthest = 0;
    for (const glm::vec3& p : points) {
        float nearest = std::numeric_limits<float>::infinity();
        for (const Segment& segment : segments) {
            if (nearest <= farthest) break; // which this point does not raise
            const glm::vec3 way = p - segment.nearest_to(p);
            nearest = std::min(nearest, glm::dot(way, way));
        }
        farthest = std::max(farthest, nearest);
    }
    return std::sqrt(farthest);
}

using namespace vdtree;
using namespace measurement;

BorderShifts::BorderShifts(const SoundTree& tree, const PlaceTriangles& mesh)
    : tree_(tree), border_(tree, mesh), interior_(tree.interior_count()), first_leaf_(tree.first_leaf()),
      leaf_end_(tree.leaf_end()), parents_(tree.parents()), triangles_(tree.triangles()),
      support_(tree.support_spheres()), levels_below_(interior_) {}

float BorderShifts::shift(NodeId node, std::span<const Index> crossing,
                          const FunctionRef<NodeId(Index leaf)>& stand_in) {
    if (border_.is_empty() || !(tree_.bounds()[node].flags & irregular_ring)) return 0;
    thread_local Scratch scratch;
    int below = 0;
    tree_.for_each_child(node, [&](NodeId child) {
        if (child < interior_) below = std::max(below, levels_below_[child] + 1);
    });
    const std::size_t looks = most_border_looks + border_looks_an_edge * (border_of(node).size() + crossing.size());
    scratch.looks_left = below < most_border_levels ? looks : 0;
    const float borders = distance_of_borders(node, crossing, stand_in, scratch);
    const float shift = turned_reach(node, crossing, borders, scratch);
    levels_below_[node] = static_cast<std::uint16_t>(scratch.looks_left > 0 ? below : most_border_levels);
    return shift;
}

std::span<const OpenBorder::End> BorderShifts::border_of(NodeId node) const {
    if (node >= interior_) return border_.at(node - interior_, node - interior_ + 1);
    const NodeId first = tree_.place_of_leaf(first_leaf_[node]), last = tree_.place_of_leaf(leaf_end_[node] - 1);
    return border_.at(first - interior_, last - interior_ + 1);
}

// Down the tree, where the ring may be nearer than what was seen. False where that was too much: then only some edges
// have been looked at.
bool BorderShifts::look_at_border(NodeId top, BorderSide& side, Scratch& scratch) const {
    constexpr std::size_t few = 16; // edges, which are looked at one by one
    const auto look_at = [&](const OpenBorder::End& end) {
        side.look_at({at_place(end.place), at_place(end.other)}, at_place(end.opposite));
    };
    if (scratch.looks_left == 0) {
        const std::span<const OpenBorder::End> ends = border_of(top);
        const std::size_t count = std::min(ends.size(), few);
        for (std::size_t i = 0; i < count; ++i) look_at(ends[i * ends.size() / count]);
        return false;
    }
    std::vector<NodeId>& waiting = scratch.waiting;
    waiting.assign(1, top);
    while (!waiting.empty()) {
        const NodeId node = waiting.back();
        waiting.pop_back();
        const std::span<const OpenBorder::End> ends = border_of(node);
        const bool is_last = ends.size() <= few || node >= interior_;
        const std::size_t looks = is_last ? ends.size() + 1 : 1;
        scratch.looks_left -= std::min(scratch.looks_left, looks);
        if (is_last) {
            for (const OpenBorder::End& end : ends) look_at(end);
            continue;
        }
        if (scratch.looks_left == 0) return look_at_border(top, side, scratch);
        const Sphere& ring = tree_.bounds()[node].ring;
        if (side.may_be_nearer(ring.centre, ring.radius))
            tree_.for_each_child(node, [&](NodeId child) { waiting.push_back(child); });
    }
    return true;
}

float BorderShifts::distance_of_borders(NodeId node, std::span<const Index> crossing,
                                        const FunctionRef<NodeId(Index)>& stand_in, Scratch& scratch) const {
    const std::span<const OpenBorder::End> ends = border_of(node);
    if (ends.empty()) return 0;
    const glm::vec3 proxy = at(node);
    scratch.folded.clear();
    scratch.folded_alone.clear();
    for (const Index t : crossing) {
        for (std::size_t k = 0; k < 3; ++k) {
            if (!((border_.edges_of(t) >> k) & 1)) continue;
            Index in = triangles_[t][k], out = triangles_[t][(k + 1) % 3];
            if (!supports(node, in)) std::swap(in, out);
            if (!supports(node, in) || supports(node, out)) continue; // not here, or vanishes
            scratch.folded.push_back({proxy, at(stand_in(out))});
            scratch.folded_alone.push_back({proxy, at_leaf(out)});
        }
    }
    scratch.points.clear();
    const std::size_t count = std::min(ends.size(), most_border_ends);
    for (std::size_t i = 0; i < count; ++i) {
        const glm::vec3& p = at_place(ends[i * ends.size() / count].place);
        if (scratch.points.empty() || scratch.points.back() != p) scratch.points.push_back(p);
    }
    float largest = 0;
    for (std::vector<Segment>* folded : {&scratch.folded, &scratch.folded_alone}) {
        if (folded->empty()) folded->push_back({proxy, proxy}); // a border of the support alone shrinks to the proxy
        largest = std::max(largest, farthest_from(*folded, scratch.points));
    }
    // The other way round: the proxy, and points between it and the neighbours. Some edges alone are never too near.
    const auto look_from = [&](const glm::vec3& p) {
        BorderSide side(p);
        look_at_border(node, side, scratch);
        largest = std::max(largest, side.distance());
    };
    look_from(proxy);
    for (const auto& [a, b] : scratch.folded_alone)
        for (const float share : {0.25f, 0.5f, 0.75f}) look_from(a + share * (b - a));
    return largest;
}

// The nodes that may stand for a leaf while they are no larger than the node, and not for another leaf, too.
void BorderShifts::find_stand_ins(Index leaf, NodeId node, Index without, std::vector<NodeId>& nodes) const {
    nodes.assign(1, tree_.place_of_leaf(leaf));
    for (NodeId up = parents_[nodes.back()];
         up != no_node && is_larger(node, up) && !supports(up, without) && nodes.size() < most_stand_ins;
         up = parents_[up])
        nodes.push_back(up);
}

// A folded sheet covers what lies beyond its folded border from both sides equally often: only triangles that have
// turned over, and others below them, lie there. In any cut, each such triangle has a largest node among its corners.
float BorderShifts::turned_reach(NodeId node, std::span<const Index> crossing, float least, Scratch& scratch) const {
    const glm::vec3 proxy = at(node);
    for (const Index t : crossing) {
        const Triangle& corners = triangles_[t];
        std::size_t k = 0;
        while (!supports(node, corners[k])) ++k;
        const Index next = corners[(k + 1) % 3], last = corners[(k + 2) % 3];
        if (supports(node, next) || supports(node, last)) continue; // vanishes
        const glm::vec3 a = at_leaf(corners[k]);
        const glm::vec3 normal = glm::cross(at_leaf(next) - a, at_leaf(last) - a);
        find_stand_ins(next, node, last, scratch.second);
        find_stand_ins(last, node, next, scratch.third);
        for (const NodeId second : scratch.second) {
            for (const NodeId third : scratch.third) {
                const glm::vec3 b = at(second) - proxy, c = at(third) - proxy, turned = glm::cross(b, c);
                if (!(glm::dot(turned, normal) < 0)) continue;
                // It reaches no farther than its least height.
                const float longest = std::max({glm::dot(b, b), glm::dot(c, c), glm::dot(c - b, c - b)});
                const float height = glm::length(turned) / std::sqrt(longest);
                if (height > least) least = std::max(least, std::min(height, reach_of(node, second, third, scratch)));
            }
        }
    }
    return least;
}

float BorderShifts::reach_of(NodeId a, NodeId b, NodeId c, Scratch& scratch) const {
    if (border_of(a).empty() && border_of(b).empty() && border_of(c).empty()) return 0;
    const glm::vec3 p = at(a), q = at(b), r = at(c);
    float reach = 0;
    for (const glm::vec3& at : {(p + q) * 0.5f, (q + r) * 0.5f, (r + p) * 0.5f, (p + q + r) / 3.0f}) {
        BorderSide side(at);
        for (const NodeId node : {a, b, c})
            if (!look_at_border(node, side, scratch)) return std::numeric_limits<float>::infinity();
        reach = std::max(reach, side.outside());
    }
    return reach;
}

} // namespace unseen::perception
