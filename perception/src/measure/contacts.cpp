#include "measure/contacts.h"

#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/fold_sequence.h>
#include <unseen/vdtree/internal/parallel.h>

namespace unseen::perception {

using namespace vdtree;

namespace {

using Corners = std::array<glm::vec3, 3>;

constexpr float near_share =
    0.25f; // of a triangle's size: no triangles of a smooth surface come so near but neighbours
// Looked at for one triangle: amid more than these, it counts as touching one.
constexpr int most_nodes = 4000;
constexpr Index at_once = 16;                 // triangles looked at together,
constexpr std::size_t most_candidates = 512;  // unless so many are near any of them
constexpr std::size_t most_listed = 100;      // triangles around a triangle's corners; amid more, pairs are looked at
constexpr std::size_t most_triangles = 16000; // around corners: no vertex of very many triangles costs their square
constexpr std::size_t most_boxes =
    std::size_t{1} << 32; // for all triangles together, in trees so flat that nodes have very many: some seconds
constexpr float infinity = std::numeric_limits<float>::infinity();

float unit(float part, float whole) { return whole > 0 ? std::clamp(part / whole, 0.0f, 1.0f) : 0.0f; }

glm::vec3 shorter(const glm::vec3& a, const glm::vec3& b) { return glm::dot(b, b) < glm::dot(a, a) ? b : a; }

// The shortest ways from a triangle to a point, and from one edge, a + [0, 1] u, to another, b + [0, 1] v.
glm::vec3 way_to_point(const Corners& t, const glm::vec3& p) {
    const glm::vec3 n = glm::cross(t[1] - t[0], t[2] - t[0]);
    const float squared = glm::dot(n, n);
    bool is_over = squared > 0;
    glm::vec3 least(infinity);
    for (std::size_t k = 0; k < 3; ++k) {
        const glm::vec3 a = t[k], ab = t[(k + 1) % 3] - a, ap = p - a;
        is_over = is_over && glm::dot(glm::cross(ab, ap), n) >= 0;
        least = shorter(least, ap - unit(glm::dot(ap, ab), glm::dot(ab, ab)) * ab);
    }
    return is_over ? (glm::dot(p - t[0], n) / squared) * n : least;
}

glm::vec3 way_between_edges(const glm::vec3& a, const glm::vec3& u, const glm::vec3& b, const glm::vec3& v) {
    const glm::vec3 w = a - b;
    const float uu = glm::dot(u, u), uv = glm::dot(u, v), vv = glm::dot(v, v), uw = glm::dot(u, w), vw = glm::dot(v, w);
    const float determinant = uu * vv - uv * uv;
    float s = determinant > 0 ? std::clamp((uv * vw - vv * uw) / determinant, 0.0f, 1.0f) : 0.0f;
    const float t = unit(s * uv + vw, vv);
    s = unit(t * uv - uw, uu);
    return w + s * u - t * v;
}

bool passes_through(const glm::vec3& a, const glm::vec3& b, const Corners& t) {
    const glm::vec3 n = glm::cross(t[1] - t[0], t[2] - t[0]);
    const float over_a = glm::dot(a - t[0], n), over_b = glm::dot(b - t[0], n);
    if (!(over_a * over_b < 0)) return false;
    const glm::vec3 at = a + (over_a / (over_a - over_b)) * (b - a);
    for (std::size_t k = 0; k < 3; ++k)
        if (!(glm::dot(glm::cross(t[(k + 1) % 3] - t[k], at - t[k]), n) >= 0)) return false;
    return true;
}

// The shortest way between triangles, whichever way round; none where they intersect.
glm::vec3 way_between(const Corners& a, const Corners& b) {
    glm::vec3 least(infinity);
    for (std::size_t i = 0; i < 3; ++i) {
        if (passes_through(a[i], a[(i + 1) % 3], b) || passes_through(b[i], b[(i + 1) % 3], a)) return glm::vec3(0);
        least = shorter(shorter(least, way_to_point(b, a[i])), way_to_point(a, b[i]));
        for (std::size_t k = 0; k < 3; ++k)
            least = shorter(least, way_between_edges(a[i], a[(i + 1) % 3] - a[i], b[k], b[(k + 1) % 3] - b[k]));
    }
    return least;
}

// Whether the one lies beside the other in one sheet, not over it: the way between them runs along both.
bool is_beside(const Corners& a, const Corners& b, const glm::vec3& way) {
    constexpr float along = 0.5f; // the cosine between way and normal, at most
    const auto runs_along = [&](const Corners& t) {
        const glm::vec3 n = glm::cross(t[1] - t[0], t[2] - t[0]);
        return std::abs(glm::dot(n, way)) <= along * glm::length(n) * glm::length(way);
    };
    return glm::dot(way, way) > 0 && runs_along(a) && runs_along(b);
}

float sine_between(const Corners& a, const Corners& b) {
    const glm::vec3 m = glm::cross(a[1] - a[0], a[2] - a[0]), n = glm::cross(b[1] - b[0], b[2] - b[0]);
    const float lengths = glm::length(m) * glm::length(n);
    return lengths > 0 ? std::min(glm::length(glm::cross(m, n)) / lengths, 1.0f) : 0.0f;
}

// Which of them is in front makes no difference: they face alike, and look alike.
constexpr float alike_cosine = 0.9f;
constexpr float alike_luminance = 0.01f; // relative, 0..1; of the means
bool face_alike(const Corners& a, const Corners& b) {
    const glm::vec3 m = glm::cross(a[1] - a[0], a[2] - a[0]), n = glm::cross(b[1] - b[0], b[2] - b[0]);
    return glm::dot(m, n) > alike_cosine * glm::length(m) * glm::length(n);
}

struct Box {
    glm::vec3 lo = glm::vec3(infinity), hi = glm::vec3(-infinity);

    void include(const Box& other) { lo = glm::min(lo, other.lo), hi = glm::max(hi, other.hi); }
    Box wider(float by) const { return {lo - by, hi + by}; }
    bool meets(const Box& other) const {
        return lo.x <= other.hi.x && lo.y <= other.hi.y && lo.z <= other.hi.z && hi.x >= other.lo.x &&
               hi.y >= other.lo.y && hi.z >= other.lo.z;
    }
};

// Looks for near triangles down the tree, by boxes around those that vanish at a node or below.
class ContactFinder {
public:
    explicit ContactFinder(std::span<const SoundTree> trees)
        : tree_(trees.front()), interior_(tree_.interior_count()), triangles_(tree_.triangles()),
          scale_(unit_scale(tree_.bounding_sphere().radius)), first_triangle_(tree_.first_triangle()),
          boxes_(interior_), mesh_(tree_),
          boxes_a_triangle_(std::max(most_triangles, most_boxes / std::max<std::size_t>(triangles_.size(), 1))) {
        is_textured_ = !trees.front().texture().empty();
        for (const SoundTree& tree : trees)
            luminances_.push_back(tree.luminance().subspan(tree.interior_wedge_count()));
        positions_.resize(tree_.place_count());
        for (Index place = 0; place < positions_.size(); ++place)
            positions_[place] = tree_.position(interior_ + place) * scale_;
        for (NodeId node = interior_; node-- > 0;) {
            for (Index t = first_triangle_[node]; t < first_triangle_[node + 1]; ++t)
                boxes_[node].include(box_of(corners(t)));
            if (node > 0) boxes_[tree_.parents()[node]].include(boxes_[node]);
        }
    }

    std::vector<Contact> run(MeasuringProgress& progress) const {
        const std::vector<Contact> contacts = by_triangle(progress);
        std::vector<Contact> all(interior_);
        const std::span<const NodeId> parents = tree_.parents();
        for (Index t = 0; t < contacts.size(); ++t)
            for (const Index place : mesh_.corners(t))
                all[parents[interior_ + place]].include({contacts[t].gap / scale_, contacts[t].sine});
        for (NodeId node = interior_; node-- > 1;) all[parents[node]].include(all[node]);
        return all;
    }

private:
    std::vector<Contact> by_triangle(MeasuringProgress& progress) const {
        std::vector<Contact> contacts(triangles_.size());
        parallel_loop_over(tbb::blocked_range<Index>(0, static_cast<Index>(triangles_.size()), 1024),
                           [&](const auto& part) {
                               Scratch scratch;
                               for (Index t = part.begin(); t < part.end() && !progress.is_cancelled(); t += at_once) {
                                   const Index end = std::min(t + at_once, part.end());
                                   find(t, end, contacts, scratch);
                                   progress.add(end - t);
                               }
                           });
        return contacts;
    }

    Corners corners(Index triangle) const {
        const Triangle& t = mesh_.corners(triangle);
        return {positions_[t[0]], positions_[t[1]], positions_[t[2]]};
    }
    bool look_alike(Index a, Index b) const {
        if (is_textured_) return false; // whatever their vertices do
        const Triangle &s = triangles_[a], &t = triangles_[b];
        return std::all_of(luminances_.begin(), luminances_.end(), [&](std::span<const Unorm16> luminance) {
            const auto mean = [&](const Triangle& of) {
                return (luminance[of[0]] + luminance[of[1]] + luminance[of[2]]) / 3;
            };
            return std::abs(mean(s) - mean(t)) <= alike_luminance;
        });
    }
    static Box box_of(const Corners& c) {
        return {glm::min(c[0], glm::min(c[1], c[2])), glm::max(c[0], glm::max(c[1], c[2]))};
    }

    // The corners of triangles around a triangle's corners; none where there are very many.
    void find_neighbours(const Triangle& triangle, std::vector<Index>& neighbours) const {
        neighbours.clear();
        std::size_t count = 0;
        for (const Index place : triangle) count += mesh_.around(place).size();
        if (count > most_listed) return;
        for (const Index place : triangle)
            for (const Index t : mesh_.around(place))
                for (const Index corner : mesh_.corners(t))
                    if (std::find(neighbours.begin(), neighbours.end(), corner) == neighbours.end())
                        neighbours.push_back(corner);
    }

    // Whether a corner of the one is a corner of the other, or shares a triangle with one. Adds what it looked at.
    bool are_neighbours(const Triangle& a, const Triangle& b, std::size_t& looked_at) const {
        for (const Index place : a)
            if (place == b[0] || place == b[1] || place == b[2]) return true;
        for (const Index place : a) {
            for (const Index other : b) {
                const bool is_less = mesh_.around(place).size() < mesh_.around(other).size();
                const Index wanted = is_less ? other : place;
                for (const Index t : mesh_.around(is_less ? place : other)) {
                    ++looked_at;
                    if (const Triangle& at = mesh_.corners(t); at[0] == wanted || at[1] == wanted || at[2] == wanted)
                        return true;
                    if (looked_at > most_triangles) return false;
                }
            }
        }
        return false;
    }

    struct Candidate {
        Box box;
        Index triangle;
    };
    struct Scratch {
        std::vector<NodeId> waiting;
        std::vector<Index> neighbours; // corners; none: not listed
        std::vector<Candidate> candidates;
    };

    float nearness(const Corners& c) const {
        const glm::vec3 centre = (c[0] + c[1] + c[2]) / 3.0f;
        return near_share *
               std::max({glm::length(c[0] - centre), glm::length(c[1] - centre), glm::length(c[2] - centre)});
    }

    // Consecutive triangles are near each other, but for some: then one walk down the tree serves all of them.
    void find(Index begin, Index end, std::span<Contact> contacts, Scratch& scratch) const {
        Box around;
        for (Index t = begin; t < end; ++t) {
            const Corners own = corners(t);
            if (const float near = nearness(own); near > 0) around.include(box_of(own).wider(near));
        }
        const bool is_for_all = look_around(around, most_candidates, scratch);
        for (Index t = begin; t < end; ++t) {
            const Corners own = corners(t);
            const float near = nearness(own);
            if (!(near > 0)) continue;
            const Box own_around = box_of(own).wider(near);
            const bool is_sparse = is_for_all || look_around(own_around, triangles_.size(), scratch);
            contacts[t] = is_sparse ? find(t, near, own_around, scratch) : Contact{0, 0};
        }
    }

    // Makes candidates of the triangles whose boxes meet one. False amid too many.
    bool look_around(const Box& around, std::size_t most, Scratch& scratch) const {
        scratch.candidates.clear();
        int nodes = 0;
        std::size_t boxes = 0;
        scratch.waiting.assign(1, VertexTree::root());
        while (!scratch.waiting.empty()) {
            const NodeId node = scratch.waiting.back();
            scratch.waiting.pop_back();
            if (++nodes > most_nodes) return false;
            for (Index t = first_triangle_[node]; t < first_triangle_[node + 1]; ++t) {
                if (++boxes > boxes_a_triangle_) return false;
                if (const Box box = box_of(corners(t)); around.meets(box)) scratch.candidates.push_back({box, t});
            }
            if (scratch.candidates.size() > most) return false;
            tree_.for_each_child(node, [&](NodeId child) {
                if (child < interior_ && around.meets(boxes_[child])) scratch.waiting.push_back(child);
            });
        }
        return true;
    }

    // Among the candidates.
    Contact find(Index triangle, float near, const Box& around, Scratch& scratch) const {
        const Corners own = corners(triangle);
        std::vector<Index>& neighbours = scratch.neighbours;
        find_neighbours(mesh_.corners(triangle), neighbours);
        std::size_t looked_at = 0;
        const auto is_neighbour = [&](const Triangle& other) {
            if (neighbours.empty()) return are_neighbours(mesh_.corners(triangle), other, looked_at);
            return std::any_of(neighbours.begin(), neighbours.end(), [&](Index place) {
                return place == other[0] || place == other[1] || place == other[2];
            });
        };
        Contact contact;
        for (const auto& [box, other] : scratch.candidates) {
            if (!around.meets(box) || is_neighbour(mesh_.corners(other))) continue;
            if (looked_at > most_triangles) return {0, 0};
            const Corners its = corners(other);
            if (face_alike(own, its) && look_alike(triangle, other)) continue;
            const glm::vec3 way = way_between(own, its);
            const float gap = glm::length(way);
            if (gap < near && !is_beside(own, its, way)) contact.include({gap, sine_between(own, its)});
        }
        return contact;
    }

    const SoundTree& tree_;
    NodeId interior_;
    std::span<const Triangle> triangles_;              // over leaves
    float scale_;                                      // in which they are measured
    std::vector<glm::vec3> positions_;                 // of places
    std::vector<std::span<const Unorm16>> luminances_; // of leaves, by tree
    bool is_textured_ = false;
    std::span<const Index> first_triangle_;
    std::vector<Box> boxes_; // by interior node
    PlaceTriangles mesh_;
    std::size_t boxes_a_triangle_; // at most
};

} // namespace

std::vector<Contact> find_contacts(std::span<const SoundTree> trees, MeasuringProgress& progress) {
    return ContactFinder(trees).run(progress);
}

} // namespace unseen::perception
