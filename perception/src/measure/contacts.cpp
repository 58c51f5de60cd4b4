#include "measure/contacts.h"

#include <cmath>
#include <numeric>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vector_relational.hpp>

#include <unseen/vdtree/internal/fold_sequence.h>
#include <unseen/vdtree/internal/parallel.h>

namespace unseen::perception {

using namespace vdtree;

namespace {

using Corners = std::array<glm::vec3, 3>;
glm::vec3 normal_of(const Corners& t) { return glm::cross(t[1] - t[0], t[2] - t[0]); } // twice the area long

// Of a triangle's size: no triangles of a smooth surface come so near but neighbours.
constexpr float near_share = 0.25f;
// Looked at for one triangle: amid more than these, it counts as touching one.
constexpr int most_nodes = 4000;
// Triangles looked at together. Amid more than so many, halves of them are, if they are apart by a share of what they
// look around, or around several hubs; else they look less far by this factor, again and again, down to this share.
constexpr Index at_once = 16;
constexpr std::size_t most_candidates = 1024;
constexpr float apart_share = 0.25f, less_far = 0.25f, least_far = 1e-6f;
constexpr std::size_t most_listed = 100;  // triangles around a triangle's corners; amid more, pairs are looked at
constexpr std::size_t most_looks = 16000; // at triangles around corners, for one triangle; amid more, it touches one
constexpr std::size_t most_boxes =
    std::size_t{1} << 32; // for all triangles together, in trees so flat that nodes have very many: some seconds
constexpr float infinity = std::numeric_limits<float>::infinity();

float unit(float part, float whole) { return whole > 0 ? std::clamp(part / whole, 0.0f, 1.0f) : 0.0f; }

glm::vec3 shorter(const glm::vec3& a, const glm::vec3& b) { return glm::dot(b, b) < glm::dot(a, a) ? b : a; }

// The shortest ways from a triangle to a point, and from one edge, a + [0, 1] u, to another, b + [0, 1] v.
glm::vec3 way_to_point(const Corners& t, const glm::vec3& p) {
    const glm::vec3 n = normal_of(t);
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
    const glm::vec3 n = normal_of(t);
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

constexpr float along = 0.5f; // the cosine between way and normal, at most

// Whether the one lies beside the other in one sheet, not over it: the way between them runs along both.
bool is_beside(const Corners& a, const Corners& b, const glm::vec3& way) {
    const auto runs_along = [&](const Corners& t) {
        const glm::vec3 n = normal_of(t);
        return std::abs(glm::dot(n, way)) <= along * glm::length(n) * glm::length(way);
    };
    return glm::dot(way, way) > 0 && runs_along(a) && runs_along(b);
}

// The shortest way by which triangles with common corners lie over each other: from their other corners, and where edges
// cross. Infinite if they do not, as back to back on the same corners, which move together.
glm::vec3 way_over(const Corners& a, const Corners& b) {
    glm::vec3 least(infinity);
    const auto include = [&](const glm::vec3& way) {
        if (!is_beside(a, b, way)) least = shorter(least, way);
    };
    const auto is_in = [](const Corners& t, const glm::vec3& p) { return p == t[0] || p == t[1] || p == t[2]; };
    for (std::size_t i = 0; i < 3; ++i) {
        if (!is_in(b, a[i])) include(way_to_point(b, a[i]));
        if (!is_in(a, b[i])) include(way_to_point(a, b[i]));
        for (std::size_t k = 0; k < 3; ++k) {
            const glm::vec3 &p = a[i], &q = a[(i + 1) % 3], &r = b[k], &s = b[(k + 1) % 3];
            if (p != r && p != s && q != r && q != s) include(way_between_edges(p, q - p, r, s - r));
        }
    }
    return least;
}

float sine_between(const Corners& a, const Corners& b) {
    const glm::vec3 m = normal_of(a), n = normal_of(b);
    const float lengths = glm::length(m) * glm::length(n);
    return lengths > 0 ? std::min(glm::length(glm::cross(m, n)) / lengths, 1.0f) : 0.0f;
}

// Which of them is in front makes no difference: they face alike, and look alike.
constexpr float alike_cosine = 0.9f;
constexpr float alike_luminance = 0.01f;   // relative, 0..1; of the means
constexpr std::size_t most_luminances = 4; // measured at once
float cosine_between(const Corners& a, const Corners& b) {
    const glm::vec3 m = normal_of(a), n = normal_of(b);
    const float lengths = glm::length(m) * glm::length(n);
    return lengths > 0 ? glm::dot(m, n) / lengths : 0;
}
bool face_alike(const Corners& a, const Corners& b) { return cosine_between(a, b) > alike_cosine; }
// The sides of a thin sheet.
bool are_back_to_back(const Corners& a, const Corners& b) { return cosine_between(a, b) < -alike_cosine; }

struct Box {
    glm::vec3 lo = glm::vec3(infinity), hi = glm::vec3(-infinity);

    void include(const glm::vec3& p) { lo = glm::min(lo, p), hi = glm::max(hi, p); }
    void include(const Box& other) { lo = glm::min(lo, other.lo), hi = glm::max(hi, other.hi); }
    Box wider(float by) const { return {lo - by, hi + by}; }
    bool meets(const Box& other) const {
        return lo.x <= other.hi.x && lo.y <= other.hi.y && lo.z <= other.hi.z && hi.x >= other.lo.x &&
               hi.y >= other.lo.y && hi.z >= other.lo.z;
    }
};

// A box along the longest side of the first triangle in it: slivers are far from filling a box along the axes.
class TurnedBox {
public:
    void include(const Corners& c, float near = 0) {
        if (is_empty_) turn_to(c);
        is_empty_ = false;
        box_.include(seen_along_axes(c).wider(near));
    }
    void include(const TurnedBox& other) {
        if (other.is_empty_) return;
        if (is_empty_) *this = other;
        else box_.include(other.seen_along(axes_));
    }
    glm::vec3 extent() const { return box_.hi - box_.lo; }
    glm::vec3 extent(const Corners& c) const {
        const Box own = seen_along_axes(c);
        return own.hi - own.lo;
    }
    bool meets(const Corners& c) const { return box_.meets(seen_along_axes(c)); }
    // Whether a triangle is beside the only one in here, included with `near`, whichever way between them is taken.
    bool is_surely_beside(const Corners& own, const Corners& c, float near) const {
        constexpr float surely = 0.9f; // for rounding
        const Box other = seen_along_axes(c);
        const glm::vec3 gaps = glm::max(other.lo - box_.hi, box_.lo - other.hi) + near;
        const float way = surely * along * std::max({gaps.x, gaps.y, gaps.z});
        const float height = std::max(box_.hi.z - other.lo.z, other.hi.z - box_.lo.z) - near;
        if (!is_in_plane_ || !(height <= way)) return false;
        const glm::vec3 n = normal_of(c);
        const float most = way * glm::length(n);
        return std::ranges::all_of(own, [&](const glm::vec3& p) { return std::abs(glm::dot(n, p - c[0])) <= most; });
    }
    bool meets(const TurnedBox& other) const { return !other.is_empty_ && box_.meets(other.seen_along(axes_)); }

private:
    Box seen_along_axes(const Corners& c) const {
        Box box;
        for (const glm::vec3& p : c) box.include(p * axes_);
        return box;
    }
    Box seen_along(const glm::mat3& axes) const {
        const glm::mat3 between = glm::transpose(axes) * axes_;
        const glm::vec3 centre = between * ((box_.lo + box_.hi) / 2.0f), half = (box_.hi - box_.lo) / 2.0f;
        const glm::vec3 reach =
            glm::abs(between[0]) * half.x + glm::abs(between[1]) * half.y + glm::abs(between[2]) * half.z;
        return {centre - reach, centre + reach};
    }
    void turn_to(const Corners& c) {
        glm::vec3 side = c[1] - c[0], other = c[2] - c[0];
        if (glm::length(other) > glm::length(side)) std::swap(side, other);
        if (glm::length(c[2] - c[1]) > glm::length(side)) side = c[2] - c[1];
        const float size = glm::length(side);
        const glm::vec3 normal = glm::cross(side / size, other / size);
        constexpr float least_height = 1e-7f; // of a triangle, over its size: below, floats know no direction
        if (!(glm::length(normal) > least_height)) return;
        axes_ = {side / size, glm::normalize(glm::cross(normal, side / size)), glm::normalize(normal)};
        is_in_plane_ = true;
    }

    Box box_; // along the axes
    glm::mat3 axes_ = glm::mat3(1);
    bool is_empty_ = true, is_in_plane_ = false; // of the first triangle
};

// What is nearer to triangles than a distance.
struct Vicinity {
    Box box;
    TurnedBox turned;

    void include(const Corners& c, float near) {
        for (const glm::vec3& p : c) box.include(Box{p - near, p + near});
        turned.include(c, near);
    }
};

// Looks for near triangles down the tree, by boxes around those that vanish at a node or below.
class ContactFinder {
public:
    ContactFinder(std::span<const SoundTree> trees, bool has_colours)
        : tree_(trees.front()), interior_(tree_.interior_count()), triangles_(tree_.triangles()),
          scale_(unit_scale(tree_.bounding_sphere().radius)), first_triangle_(tree_.first_triangle()),
          boxes_(interior_), turned_boxes_(interior_), mesh_(tree_),
          boxes_a_triangle_(std::max(most_looks, most_boxes / std::max<std::size_t>(triangles_.size(), 1))) {
        is_painted_ = has_colours || !trees.front().texture().empty();
        for (const SoundTree& tree : trees) {
            luminances_.push_back(tree.luminance().subspan(tree.interior_wedge_count()));
            ring_luminances_.push_back(tree.ring_luminance());
        }
        positions_.resize(tree_.place_count());
        for (Index place = 0; place < positions_.size(); ++place)
            positions_[place] = tree_.position(interior_ + place) * scale_;
        for (NodeId node = interior_; node-- > 0;) {
            for (Index t = first_triangle_[node]; t < first_triangle_[node + 1]; ++t)
                boxes_[node].include(box_of(corners(t))), turned_boxes_[node].include(corners(t));
            if (node == 0) break;
            boxes_[tree_.parents()[node]].include(boxes_[node]);
            turned_boxes_[tree_.parents()[node]].include(turned_boxes_[node]);
        }
        find_hubs();
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
    // A place of more triangles than are listed. All of them are near each other, and neighbours.
    bool is_hub(Index place) const { return mesh_.around(place).size() > most_listed; }

    // What vanishes at a node or below it, apart by hubs.
    struct Parts {
        Box without, with;                                              // triangles without a hub, and with one
        Index hub = no_hub;                                             // the hub of the latter,
        static constexpr Index no_hub = no_node, several = no_node - 1; // or this

        void include(Index other) { hub = hub == no_hub || hub == other ? other : several; }
        void include(const Parts& other) {
            without.include(other.without);
            with.include(other.with);
            if (other.hub != no_hub) include(other.hub);
        }
    };
    void find_hubs() {
        Index place = 0;
        while (place < tree_.place_count() && !is_hub(place)) ++place;
        if (place == tree_.place_count()) return;
        hub_at_.assign(tree_.place_count(), Parts::no_hub);
        for (Index t = 0; t < triangles_.size(); ++t) note_hubs(mesh_.corners(t));
        std::sort(hub_edges_.begin(), hub_edges_.end());
        hub_edges_.erase(std::unique(hub_edges_.begin(), hub_edges_.end()), hub_edges_.end());
        parts_.resize(interior_);
        for (NodeId node = interior_; node-- > 0;) {
            Parts& parts = parts_[node];
            for (Index t = first_triangle_[node]; t < first_triangle_[node + 1]; ++t) {
                const Index hub = first_hub(t);
                (hub == Parts::no_hub ? parts.without : parts.with).include(box_of(corners(t)));
                if (hub != Parts::no_hub && !has_corner(t, parts.hub)) parts.include(hub);
            }
            if (node > 0) parts_[tree_.parents()[node]].include(parts);
        }
    }
    void note_hubs(const Triangle& corners) {
        for (const Index hub : corners) {
            if (!is_hub(hub)) continue;
            for (const Index place : corners) {
                if (place == hub) continue;
                if (is_hub(place)) hub_edges_.emplace_back(place, hub);
                else hub_at_[place] = hub_at_[place] == Parts::no_hub || hub_at_[place] == hub ? hub : Parts::several;
            }
        }
    }
    bool has_corner(Index triangle, Index place) const {
        const Triangle& t = mesh_.corners(triangle);
        return t[0] == place || t[1] == place || t[2] == place;
    }
    // Of a triangle's hubs, that of the lowest number.
    Index first_hub(Index triangle) const {
        Index first = Parts::no_hub;
        for (const Index corner : mesh_.corners(triangle))
            if (is_hub(corner)) first = std::min(first, corner);
        return first;
    }
    bool has_hub(Index triangle, Index hub) const {
        return hub == Parts::no_hub ? hub_of(triangle) == hub : has_corner(triangle, hub);
    }
    Index hub_of(Index triangle) const { return parts_.empty() ? Parts::no_hub : first_hub(triangle); }
    // Whether triangles at a node or below it, except for those around the hub, may be near.
    bool may_meet(const Vicinity& around, NodeId node, Index hub) const {
        if (!around.box.meets(boxes_[node]) || !around.turned.meets(turned_boxes_[node])) return false;
        if (hub == Parts::no_hub) return true;
        const Parts& parts = parts_[node];
        return around.box.meets(parts.without) || (parts.hub != hub && around.box.meets(parts.with));
    }

    std::vector<Contact> by_triangle(MeasuringProgress& progress) const {
        const auto count = static_cast<Index>(triangles_.size());
        std::vector<Contact> contacts(count);
        parallel_loop_over(tbb::blocked_range<Index>(0, (count + at_once - 1) / at_once, 64), [&](const auto& part) {
            Scratch scratch;
            for (Index i = part.begin(); i < part.end() && !progress.is_cancelled(); ++i) {
                std::array<Index, at_once> triangles;
                std::iota(triangles.begin(), triangles.end(), i * at_once);
                const std::span group(triangles.data(), std::min(at_once, count - i * at_once));
                find(group, 1, contacts, scratch);
                progress.add(static_cast<double>(group.size()));
            }
        });
        return contacts;
    }

    Corners corners(Index triangle) const {
        const Triangle& t = mesh_.corners(triangle);
        return {positions_[t[0]], positions_[t[1]], positions_[t[2]]};
    }
    bool look_alike(Index a, Index b) const {
        if (is_painted_) return false; // whatever their vertices do
        const Triangle &s = triangles_[a], &t = triangles_[b];
        return std::all_of(luminances_.begin(), luminances_.end(), [&](std::span<const Unorm16> luminance) {
            return std::abs(mean(luminance, s) - mean(luminance, t)) <= alike_luminance;
        });
    }
    static float mean(std::span<const Unorm16> luminance, const Triangle& of) {
        return (luminance[of[0]] + luminance[of[1]] + luminance[of[2]]) / 3;
    }

    static Box box_of(const Corners& c) {
        return {glm::min(c[0], glm::min(c[1], c[2])), glm::max(c[0], glm::max(c[1], c[2]))};
    }

    // What is near a triangle because it is a neighbour, or a neighbour's neighbour: triangles with a corner that is
    // listed, and with one that is a hub or shares a triangle with one. Not listed amid many triangles.
    struct Neighbours {
        std::vector<Index> corners, hubs;
        bool are_listed = false;
    };
    void find_neighbours(const Triangle& triangle, Neighbours& found) const {
        found.corners.clear(), found.hubs.clear();
        std::size_t count = 0;
        for (const Index place : triangle) {
            if (is_hub(place)) found.hubs.push_back(place);
            else count += mesh_.around(place).size();
        }
        found.are_listed = count <= most_listed;
        if (!found.are_listed) return;
        for (const Index place : triangle) {
            if (is_hub(place)) continue;
            for (const Index t : mesh_.around(place))
                for (const Index corner : mesh_.corners(t))
                    if (std::find(found.corners.begin(), found.corners.end(), corner) == found.corners.end())
                        found.corners.push_back(corner);
        }
    }
    bool is_neighbour(const Neighbours& listed, const Triangle& other) const {
        return std::any_of(other.begin(), other.end(), [&](Index corner) {
            const auto is_near_hub = [&](Index hub) { return corner == hub || touches_hub(corner, hub); };
            return std::find(listed.corners.begin(), listed.corners.end(), corner) != listed.corners.end() ||
                   std::any_of(listed.hubs.begin(), listed.hubs.end(), is_near_hub);
        });
    }

    // Whether a place shares a triangle with a hub.
    bool touches_hub(Index place, Index hub) const {
        if (is_hub(place)) return std::binary_search(hub_edges_.begin(), hub_edges_.end(), std::pair(place, hub));
        if (hub_at_[place] != Parts::several) return hub_at_[place] == hub;
        const std::span<const Index> around = mesh_.around(place);
        return std::any_of(around.begin(), around.end(), [&](Index t) { return has_corner(t, hub); });
    }

    // Whether a corner of the one is a corner of the other, or shares a triangle with one. Adds what it looked at.
    bool are_neighbours(const Triangle& a, const Triangle& b, std::size_t& looked_at) const {
        for (const Index place : a)
            if (place == b[0] || place == b[1] || place == b[2]) return true;
        for (const Index place : a) {
            for (const Index other : b) {
                if (is_hub(place) || is_hub(other)) {
                    const bool is_first = is_hub(place);
                    if (touches_hub(is_first ? other : place, is_first ? place : other)) return true;
                    continue;
                }
                for (const Index t : mesh_.around(place)) {
                    ++looked_at;
                    if (has_corner(t, other)) return true;
                    if (looked_at > most_looks) return false;
                }
            }
        }
        return false;
    }

    // What triangles that are looked at together are like.
    struct Looks {
        Box normals;
        std::array<LuminanceRange, most_luminances> means; // by tree
        bool is_known = true;
    };
    void include(Index triangle, Looks& looks) const {
        const Corners c = corners(triangle);
        const glm::vec3 normal = normal_of(c);
        const float length = glm::length(normal);
        looks.is_known = looks.is_known && length > 0 && !is_painted_ && luminances_.size() <= most_luminances;
        if (!looks.is_known) return;
        const bool is_first = looks.normals.lo.x > looks.normals.hi.x;
        looks.normals.include(normal / length);
        for (std::size_t i = 0; i < luminances_.size(); ++i) {
            const float own = mean(luminances_[i], triangles_[triangle]);
            LuminanceRange& range = looks.means[i];
            range =
                is_first ? LuminanceRange{own, own} : LuminanceRange{std::min(range.lo, own), std::max(range.hi, own)};
        }
    }
    // Whether all triangles that vanish at a node or below it face and look like these, for sure.
    bool are_all_alike(const Looks& looks, NodeId node) const {
        if (!looks.is_known) return false;
        const NormalSlabs& slabs = tree_.bounds()[node].slabs;
        float least_cosine = 0;
        for (int k = 0; k < 3; ++k) {
            const float lo = slabs.lo[static_cast<std::size_t>(k)] / 127.0f,
                        hi = slabs.hi[static_cast<std::size_t>(k)] / 127.0f, a = looks.normals.lo[k],
                        b = looks.normals.hi[k];
            least_cosine += std::min({a * lo, a * hi, b * lo, b * hi});
        }
        constexpr float rounding = 1e-5f;
        if (!(least_cosine > alike_cosine + rounding)) return false;
        for (std::size_t i = 0; i < luminances_.size(); ++i) {
            const LuminanceRange its = ring_luminances_[i][node], own = looks.means[i];
            if (!(std::max(its.hi - own.lo, own.hi - its.lo) <= alike_luminance - rounding)) return false;
        }
        return true;
    }

    struct Candidate {
        Box box;
        Index triangle;
    };
    struct Scratch {
        std::vector<NodeId> waiting;
        Neighbours neighbours;
        std::vector<Candidate> candidates;
    };

    float nearness(const Corners& c) const {
        const glm::vec3 centre = (c[0] + c[1] + c[2]) / 3.0f;
        return near_share *
               std::max({glm::length(c[0] - centre), glm::length(c[1] - centre), glm::length(c[2] - centre)});
    }

    // Consecutive triangles are near each other, but for some: one walk down the tree serves all of them. Amid so many
    // triangles that only a share of what is near is looked at, others may touch them just beyond.
    void find(std::span<Index> group, float share, std::span<Contact> contacts, Scratch& scratch) const {
        Vicinity around;
        Looks looks;
        const Index hub = hub_of(group.front());
        glm::vec3 widest(0);
        for (const Index t : group) {
            const Corners own = corners(t);
            const float near = share * nearness(own);
            if (!(near > 0)) continue;
            around.include(own, near), include(t, looks);
            widest = glm::max(widest, around.turned.extent(own) + 2 * near);
        }
        const auto others = std::stable_partition(group.begin(), group.end(), [&](Index t) { return has_hub(t, hub); });
        const auto same_hub = static_cast<std::size_t>(others - group.begin());
        const bool is_one = same_hub == group.size(), is_nearest = share <= least_far;
        if (look_around(around, looks, is_one ? hub : Parts::no_hub, scratch)) {
            for (const Index t : group) {
                const float near = share * nearness(corners(t));
                if (!(near > 0)) continue;
                contacts[t] = find(t, near, scratch);
                if (share < 1) contacts[t].include({near, 0});
            }
            return;
        }
        const bool are_apart =
            !is_one || is_nearest || glm::any(glm::greaterThan(around.turned.extent(), (1 + apart_share) * widest));
        if (group.size() > 1 && are_apart) {
            const std::size_t first = is_one ? group.size() / 2 : same_hub;
            for (const auto part : {group.first(first), group.subspan(first)})
                find(part, is_nearest ? less_far : share, contacts, scratch);
        } else if (!is_nearest) {
            find(group, less_far * share, contacts, scratch);
        } else {
            contacts[group.front()] = {0, 0};
        }
    }

    // Makes candidates of the triangles whose boxes meet one, but for those around a hub, and whole subtrees of those
    // that are alike. False amid too many.
    bool look_around(const Vicinity& around, const Looks& looks, Index hub, Scratch& scratch) const {
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
                if (hub != Parts::no_hub && has_corner(t, hub)) continue;
                if (const Box box = box_of(corners(t)); around.box.meets(box) && around.turned.meets(corners(t)))
                    scratch.candidates.push_back({box, t});
            }
            if (scratch.candidates.size() > most_candidates) return false;
            tree_.for_each_child(node, [&](NodeId child) {
                if (child < interior_ && may_meet(around, child, hub) && !are_all_alike(looks, child))
                    scratch.waiting.push_back(child);
            });
        }
        return true;
    }

    // Among the candidates.
    Contact find(Index triangle, float near, Scratch& scratch) const {
        const Corners own = corners(triangle);
        Vicinity around;
        around.include(own, near);
        Neighbours& neighbours = scratch.neighbours;
        find_neighbours(mesh_.corners(triangle), neighbours);
        std::size_t looked_at = 0;
        const auto is_near_by = [&](const Triangle& other) {
            return neighbours.are_listed ? is_neighbour(neighbours, other)
                                         : are_neighbours(mesh_.corners(triangle), other, looked_at);
        };
        Contact contact;
        for (const auto& [box, other] : scratch.candidates) {
            const Corners its = corners(other);
            if (!around.box.meets(box) || !around.turned.meets(its) || around.turned.is_surely_beside(own, its, near))
                continue;
            const bool is_neighbour = is_near_by(mesh_.corners(other));
            if (looked_at > most_looks) return {0, 0};
            if (is_neighbour ? !are_back_to_back(own, its) : face_alike(own, its) && look_alike(triangle, other))
                continue;
            const glm::vec3 way = is_neighbour ? way_over(own, its) : way_between(own, its);
            const float gap = glm::length(way);
            if (gap < near && !is_beside(own, its, way)) contact.include({gap, sine_between(own, its)});
        }
        return contact;
    }

    const SoundTree& tree_;
    NodeId interior_;
    std::span<const Triangle> triangles_;                       // over leaves
    float scale_;                                               // in which they are measured
    std::vector<glm::vec3> positions_;                          // of places
    std::vector<std::span<const Unorm16>> luminances_;          // of leaves, by tree
    std::vector<std::span<const PackedRange>> ring_luminances_; // by interior node, likewise
    bool is_painted_ = false;
    std::span<const Index> first_triangle_;
    std::vector<Box> boxes_;              // by interior node
    std::vector<TurnedBox> turned_boxes_; // likewise
    // Empty without hubs.
    std::vector<Parts> parts_;  // likewise
    std::vector<Index> hub_at_; // by place: that it shares a triangle with
    std::vector<std::pair<Index, Index>> hub_edges_;
    PlaceTriangles mesh_;
    std::size_t boxes_a_triangle_; // at most
};

} // namespace

std::vector<Contact> find_contacts(std::span<const SoundTree> trees, bool has_colours, MeasuringProgress& progress) {
    return ContactFinder(trees, has_colours).run(progress);
}

} // namespace unseen::perception
