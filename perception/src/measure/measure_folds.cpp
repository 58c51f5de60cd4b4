// Compares every fold with the surface before it, by points and by small pictures, from the leaves up.
#include <perception/fold_measurement.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <iterator>
#include <limits>
#include <string>
#include <thread>

#include <glm/geometric.hpp>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <vdtree/internal/scaled_geometry.h>
#include <vdtree/internal/vertex_tree_data.h>

#include "fold/fold_errors.h"
#include "measure/contacts.h"
#include "measure/find_stages.h"
#include "measure/fold_picture.h"
#include "measure/fold_record.h"
#include "measure/leaf_triangles.h"
#include "measure/luminance_bias.h"
#include "measure/measurement.h"

namespace unseen::perception {

using namespace vdtree;
using namespace measurement;

namespace {

constexpr Index none = 0xffffffffu;
constexpr Index leaves_of_part = 4096; // of a subtree that one task measures
constexpr float infinity = std::numeric_limits<float>::infinity();

using Point = LitPoint;

struct Difference {
    float distance = 0, luminance = 0;
    void include(const Difference& other) {
        distance = std::max(distance, other.distance);
        luminance = std::max(luminance, other.luminance);
    }
};

// Of a ring, before or after the fold.
struct RingTriangle {
    Point corner[3];
    unsigned inside = 0; // a bit for each corner in the support
};

// The directions of normals along the slabs' axes.
class NormalReach {
public:
    void insert(const RingTriangle& t) {
        const glm::vec3 a = t.corner[0].position;
        glm::vec3 n = glm::cross(t.corner[1].position - a, t.corner[2].position - a);
        const float squared = glm::dot(n, n);
        if (!(squared > 0)) return;
        n /= std::sqrt(squared);
        const float along[NormalSlabs::axis_count] = {n.x,
                                                      n.y,
                                                      n.z,
                                                      (n.x + n.y + n.z) * inverse_sqrt3,
                                                      (-n.x + n.y + n.z) * inverse_sqrt3,
                                                      (n.x - n.y + n.z) * inverse_sqrt3,
                                                      (n.x + n.y - n.z) * inverse_sqrt3};
        for (std::size_t i = 0; i < NormalSlabs::axis_count; ++i) {
            low_[i] = std::min(low_[i], along[i]);
            high_[i] = std::max(high_[i], along[i]);
        }
    }

    NormalSlabs slabs() const {
        NormalSlabs slabs;
        if (low_[0] > high_[0]) return slabs;
        for (std::size_t i = 0; i < NormalSlabs::axis_count; ++i) {
            slabs.lo[i] = static_cast<std::int8_t>(std::max(std::floor(low_[i] * units - margin), -units));
            slabs.hi[i] = static_cast<std::int8_t>(std::min(std::ceil(high_[i] * units + margin), units));
        }
        return slabs;
    }

private:
    static constexpr float inverse_sqrt3 = 0.57735026918962576f, units = 127;
    static constexpr float margin = 1e-3f; // units; a hundred times the rounding of a normal
    std::array<float, NormalSlabs::axis_count> low_{2, 2, 2, 2, 2, 2, 2}, high_{-2, -2, -2, -2, -2, -2, -2};
};

// Triangles by columns, so that one point is compared with several at once.
class Surface {
public:
    void assign(std::span<const RingTriangle> rings) {
        size_ = rings.size();
        for (auto* column : {&a_x_, &a_y_, &a_z_, &b_x_, &b_y_, &b_z_, &c_x_, &c_y_, &c_z_, &a_l_, &b_l_, &c_l_, &bb_,
                             &bc_, &cc_, &inverse_, &squared_, &luminance_})
            column->resize(size_);
        for (std::size_t i = 0; i < size_; ++i) {
            const auto& [a, b, c] = rings[i].corner;
            const glm::vec3 ab = b.position - a.position, ac = c.position - a.position;
            a_x_[i] = a.position.x, a_y_[i] = a.position.y, a_z_[i] = a.position.z, a_l_[i] = a.luminance;
            b_x_[i] = ab.x, b_y_[i] = ab.y, b_z_[i] = ab.z, b_l_[i] = b.luminance - a.luminance;
            c_x_[i] = ac.x, c_y_[i] = ac.y, c_z_[i] = ac.z, c_l_[i] = c.luminance - a.luminance;
            bb_[i] = glm::dot(ab, ab), bc_[i] = glm::dot(ab, ac), cc_[i] = glm::dot(ac, ac);
            const float determinant = bb_[i] * cc_[i] - bc_[i] * bc_[i];
            inverse_[i] =
                determinant > least_determinant * bb_[i] * cc_[i] ? 1 / determinant : 0; // 0: only its edges count
        }
    }
    bool empty() const { return size_ == 0; }

    // From the nearest of its points.
    Difference compare(const Point& p) {
        measure(p.position.x, p.position.y, p.position.z);
        const auto nearest =
            static_cast<std::size_t>(std::min_element(squared_.begin(), squared_.end()) - squared_.begin());
        return {std::sqrt(squared_[nearest]), std::abs(p.luminance - luminance_[nearest])};
    }

private:
    // Triangles whose area is less than a thousandth of its edges' squares count by their edges.
    static constexpr float least_determinant = 1e-6f;

    // The nearest point a + v ab + w ac of each triangle: of its inside, where the foot of the perpendicular lies
    // there, or of an edge.
#if defined(__x86_64__) && defined(__GNUC__)
    [[gnu::target_clones("avx2", "default")]]
#endif
    void
    measure(float x, float y, float z) {
        const float *ax = a_x_.data(), *ay = a_y_.data(), *az = a_z_.data(), *bx = b_x_.data(), *by = b_y_.data(),
                    *bz = b_z_.data();
        const float *cx = c_x_.data(), *cy = c_y_.data(), *cz = c_z_.data(), *al = a_l_.data(), *bl = b_l_.data(),
                    *cl = c_l_.data();
        const float *bb = bb_.data(), *bc = bc_.data(), *cc = cc_.data(), *inverse = inverse_.data();
        float *squared = squared_.data(), *luminance = luminance_.data();
        const std::size_t count = size_;
        const auto share = [](float part, float whole) {
            const float s = whole > 0 ? part / whole : 0;
            return s > 0 ? (s < 1 ? s : 1.0f) : 0.0f;
        };
#pragma GCC ivdep
        for (std::size_t i = 0; i < count; ++i) {
            const float px = x - ax[i], py = y - ay[i], pz = z - az[i];
            const float pb = px * bx[i] + py * by[i] + pz * bz[i], pc = px * cx[i] + py * cy[i] + pz * cz[i];
            const auto cost = [&](float v, float w) {
                return v * (v * bb[i] + 2 * w * bc[i] - 2 * pb) + w * (w * cc[i] - 2 * pc);
            };
            const float v0 = (cc[i] * pb - bc[i] * pc) * inverse[i], w0 = (bb[i] * pc - bc[i] * pb) * inverse[i];
            const float on_ab = share(pb, bb[i]), on_ac = share(pc, cc[i]);
            const float on_bc = share(pc - pb - bc[i] + bb[i], bb[i] - 2 * bc[i] + cc[i]);
            const float cost_ab = cost(on_ab, 0), cost_ac = cost(0, on_ac), cost_bc = cost(1 - on_bc, on_bc);
            float v = cost_ab < cost_ac ? on_ab : 0, w = cost_ab < cost_ac ? 0 : on_ac;
            const float least = cost_ab < cost_ac ? cost_ab : cost_ac;
            v = cost_bc < least ? 1 - on_bc : v;
            w = cost_bc < least ? on_bc : w;
            const bool is_inside = (inverse[i] > 0) & (v0 >= 0) & (w0 >= 0) & (v0 + w0 <= 1);
            v = is_inside ? v0 : v;
            w = is_inside ? w0 : w;
            const float dx = px - v * bx[i] - w * cx[i], dy = py - v * by[i] - w * cy[i],
                        dz = pz - v * bz[i] - w * cz[i];
            squared[i] = dx * dx + dy * dy + dz * dz;
            luminance[i] = al[i] + v * bl[i] + w * cl[i];
        }
    }

    std::size_t size_ = 0;
    // The corner a; b and c from there; their products.
    std::vector<float> a_x_, a_y_, a_z_, b_x_, b_y_, b_z_, c_x_, c_y_, c_z_, a_l_, b_l_, c_l_, bb_, bc_, cc_, inverse_;
    std::vector<float> squared_, luminance_; // of the last comparison
};

class Measurer {
public:
    Measurer(const SoundTree& tree, std::vector<FoldRecord>& records, std::vector<FoldFacing>& facing)
        : tree_(tree), records_(records), facing_(facing), positions_(tree.positions()), luminance_(tree.luminance()),
          support_luminance_(tree.support_luminance()), first_leaf_(tree.first_leaf()), leaf_end_(tree.leaf_end()),
          parents_(tree.parents()), first_triangle_(tree.first_triangle()), triangles_(tree.triangles()),
          support_(tree.support_spheres()), interior_(tree.interior_count()), of_leaf_(tree), crossing_(interior_),
          contacts_(find_contacts(tree)), witnesses_(interior_) {}

    // False where `progress` has cancelled; it is called on the calling thread only.
    bool run(const Progress& progress) {
        std::vector<NodeId> parts, above;
        for (NodeId node = 0; node < interior_;) {
            const bool is_part = leaf_end_[node] - first_leaf_[node] <= leaves_of_part;
            (is_part ? parts : above).push_back(node);
            node = is_part ? tree_.subtree_end()[node] : node + 1;
        }
        const std::thread::id caller = std::this_thread::get_id();
        std::atomic<NodeId> done = 0;
        std::atomic<bool> is_cancelled = false;
        const auto go_on = [&](NodeId more) {
            const double share = static_cast<double>(done += more) / interior_;
            if (progress && std::this_thread::get_id() == caller && !progress(share, stage)) is_cancelled = true;
            return !is_cancelled;
        };
        tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t i) {
            if (is_cancelled) return;
            const NodeId begin = parts[i], end = tree_.subtree_end()[begin];
            Scratch scratch;
            for (NodeId node = end; node-- > begin;) measure(node, scratch);
            go_on(end - begin);
        });
        Scratch scratch;
        for (std::size_t i = above.size(); i-- > 0 && go_on(1);) measure(above[i], scratch);
        return go_on(0);
    }

private:
    static constexpr const char* stage = "measuring folds";

    struct Mean {
        Difference sum;
        int count = 0;
        void include(const Difference& other) {
            sum.distance += other.distance;
            sum.luminance += other.luminance;
            ++count;
        }
        Difference value() const {
            const float share = 1 / static_cast<float>(std::max(count, 1));
            return {sum.distance * share, sum.luminance * share};
        }
    };
    struct Sample {
        Point point;
        Index leaf;      // none for points that are no leaves
        bool is_typical; // not chosen for its error
        Difference error;
    };
    struct Child {
        Index first_leaf;
        NodeId node;
    };
    // Triangles that touch the support, before and after the fold: with folded neighbours, and with none folded.
    struct Scratch {
        std::vector<RingTriangle> before, after, fine_before, fine_after;
        Surface before_surface, after_surface;
        std::vector<Sample> samples;
        std::vector<Child> children;
        FoldPicture picture;

        void clear() {
            for (auto* surface : {&before, &after, &fine_before, &fine_after}) surface->clear();
            samples.clear();
            children.clear();
        }
    };
    using Witnesses = std::array<Index, witness_count>;

    Point point(NodeId node) const { return {positions_[node], luminance_[node]}; }
    Point leaf_point(Index leaf) const { return point(interior_ + leaf); }

    // Triangles with a corner in the support that the children, folded, leave.
    std::vector<Index> crossing(NodeId node) {
        std::vector<Index> all;
        tree_.for_each_child(node, [&](NodeId child) {
            if (tree_.is_leaf(child)) {
                const Index leaf = child - interior_;
                const std::span<const Index> around = of_leaf_.around(leaf);
                all.insert(all.end(), around.begin(), around.end());
                return;
            }
            for (const Index t : crossing_[child])
                if (t < first_triangle_[child] || t >= first_triangle_[child + 1]) all.push_back(t);
            std::vector<Index>().swap(crossing_[child]);
        });
        std::sort(all.begin(), all.end());
        all.erase(std::unique(all.begin(), all.end()), all.end());
        return all;
    }

    bool is_larger(NodeId a, NodeId b) const { // ancestors are larger than their descendants
        return support_[a].radius != support_[b].radius ? support_[a].radius > support_[b].radius : a < b;
    }

    // What stands for a leaf outside the node when it folds: nodes up to its size are folded, as far as they have no
    // more to hide.
    NodeId stand_in(Index leaf, NodeId node) const {
        NodeId at = interior_ + leaf;
        const int most = much_more * luminance_span(node);
        int steps = 0;
        for (NodeId up = parents_[at];
             up != no_node && is_larger(node, up) && luminance_span(up) <= most && ++steps <= most_steps;
             up = parents_[at])
            at = up;
        return at;
    }
    int luminance_span(NodeId node) const {
        return support_luminance_[node].hi.value - support_luminance_[node].lo.value;
    }

    void measure(NodeId node, Scratch& scratch) {
        crossing_[node] = crossing(node);
        const Point proxy = point(node);
        facing_[node].facing = lay_out(node, scratch).slabs();
        if (scratch.after.empty()) scratch.after.push_back({{proxy, proxy, proxy}, 7}); // all of it vanishes
        Difference worst;
        const Difference mean = compare_surfaces(node, scratch, worst);
        FoldRecord& record = records_[node];
        record.farthest = worst.distance, record.mean_distance = mean.distance;
        record.largest_luminance = worst.luminance, record.mean_luminance = mean.luminance;
        record.extent = mean_reach(scratch.after, proxy) / 2;
        record.gap = contacts_[node].gap, record.sine = contacts_[node].sine;
        facing_[node].is_height_field = draw(node, scratch, std::max(support_[node].radius, record.extent), record);
    }

    // Puts the ring before and after the fold, coarse and fine, into `scratch`; returns what its triangles face.
    NormalReach lay_out(NodeId node, Scratch& scratch) {
        const Index begin = first_leaf_[node], end = leaf_end_[node];
        const auto is_inside = [&](Index leaf) { return leaf - begin < end - begin; };
        scratch.clear();
        tree_.for_each_child(node, [&](NodeId child) {
            scratch.children.push_back({tree_.is_leaf(child) ? child - interior_ : first_leaf_[child], child});
        });
        const auto child_of = [&](Index leaf) {
            const auto after = std::upper_bound(scratch.children.begin(), scratch.children.end(), leaf,
                                                [](Index l, const Child& child) { return l < child.first_leaf; });
            return std::prev(after)->node;
        };
        NormalReach turned;
        const auto add = [&](std::vector<RingTriangle>& surface, const RingTriangle& t) {
            surface.push_back(t);
            turned.insert(t);
        };
        for (const Index t : crossing_[node]) {
            RingTriangle whole, before, after;
            std::array<NodeId, 3> shown, shown_before;
            whole.inside = 0;
            for (std::size_t k = 0; k < 3; ++k) {
                const Index leaf = triangles_[t][k];
                const bool is_here = is_inside(leaf);
                whole.corner[k] = leaf_point(leaf);
                whole.inside |= static_cast<unsigned>(is_here) << k;
                shown[k] = is_here ? node : stand_in(leaf, node);
                shown_before[k] = is_here ? child_of(leaf) : shown[k];
            }
            before.inside = after.inside = whole.inside;
            for (std::size_t k = 0; k < 3; ++k) {
                before.corner[k] = point(shown_before[k]);
                after.corner[k] = point(shown[k]);
            }
            turned.insert(whole);
            if (are_distinct(shown_before)) add(scratch.before, before);
            RingTriangle fine_before = whole;
            std::array<NodeId, 3> shown_fine = shown_before;
            for (std::size_t k = 0; k < 3; ++k) {
                if ((whole.inside >> k) & 1) fine_before.corner[k] = before.corner[k];
                else shown_fine[k] = interior_ + triangles_[t][k];
            }
            if (are_distinct(shown_fine)) scratch.fine_before.push_back(fine_before);
            if (t >= first_triangle_[node] && t < first_triangle_[node + 1]) continue; // vanishes here
            RingTriangle fine = whole;
            for (std::size_t k = 0; k < 3; ++k)
                if ((whole.inside >> k) & 1) fine.corner[k] = point(node);
            add(scratch.fine_after, fine);
            if (are_distinct(shown)) add(scratch.after, after);
        }
        return turned;
    }

    // Raises the worst errors to those between the surfaces; returns the mean ones.
    Difference compare_surfaces(NodeId node, Scratch& scratch, Difference& worst) {
        scratch.before_surface.assign(scratch.before);
        scratch.after_surface.assign(scratch.after);
        add_samples(node, scratch);
        Mean over_leaves, over_before, over_after;
        for (Sample& sample : scratch.samples) {
            sample.error = scratch.after_surface.compare(sample.point);
            worst.include(sample.error);
            if (sample.is_typical) over_leaves.include(sample.error);
        }
        choose_witnesses(node, scratch.samples);
        compare(scratch.before, scratch.after_surface, worst, over_before);
        compare(scratch.after, scratch.before_surface, worst, over_after);
        Difference mean = over_leaves.value();
        mean.include(over_before.value());
        mean.include(over_after.value());
        if (scratch.fine_before.size() <= most_fine_triangles) {
            Mean over_fine_before, over_fine_after;
            scratch.before_surface.assign(scratch.fine_before);
            scratch.after_surface.assign(scratch.fine_after);
            compare(scratch.fine_before, scratch.after_surface, worst, over_fine_before);
            compare(scratch.fine_after, scratch.before_surface, worst, over_fine_after);
            mean.include(over_fine_before.value());
            mean.include(over_fine_after.value());
        }
        return mean;
    }

    // Compares pictures of the mesh with those of the folded surface: with folded neighbours, and with none folded.
    // Returns whether nothing is hidden under something else.
    bool draw(NodeId node, Scratch& scratch, float width, FoldRecord& record) const {
        glm::vec3 normal(0);
        for (const RingTriangle& t : scratch.after) {
            const glm::vec3 a = t.corner[0].position;
            normal += glm::cross(t.corner[1].position - a, t.corner[2].position - a);
        }
        const float length = glm::length(normal);
        if (!(length > 0) || !(width > 0)) return false;
        FoldPicture& picture = scratch.picture;
        bool is_height_field = true;
        for (std::size_t size = 0; size < picture_sizes.size(); ++size) {
            const auto compare = [&](std::span<const RingTriangle> folded) {
                picture.clear(FoldPicture::Layer::folded);
                for (const RingTriangle& t : folded)
                    picture.draw(FoldPicture::Layer::folded, t.corner[0], t.corner[1], t.corner[2]);
                record.shift = std::max(record.shift, picture.shift());
                const std::array<float, picture_bands> amplitudes = picture.amplitudes();
                for (std::size_t band = 0; band < picture_bands; ++band)
                    record.amplitudes[size][band] = std::max(record.amplitudes[size][band], amplitudes[band]);
            };
            picture.look(positions_[node], normal / length, picture_sizes[size] * width);
            draw_mesh(node, scratch, picture);
            compare(scratch.after);
            if (scratch.fine_before.size() <= most_fine_triangles) compare(scratch.fine_after);
            is_height_field &= picture.is_height_field();
        }
        return is_height_field;
    }

    // The mesh around the support.
    void draw_mesh(NodeId node, const Scratch& scratch, FoldPicture& picture) const {
        const auto draw = [&](Index t) {
            const Triangle& corners = triangles_[t];
            picture.draw(FoldPicture::Layer::mesh, leaf_point(corners[0]), leaf_point(corners[1]),
                         leaf_point(corners[2]));
        };
        const Index first = first_triangle_[node],
                    end = first_triangle_[tree_.subtree_end()[node]]; // those that vanish in the support
        if (end - first > most_triangles_drawn) {
            for (const RingTriangle& t : scratch.before)
                picture.draw(FoldPicture::Layer::mesh, t.corner[0], t.corner[1], t.corner[2]);
            return;
        }
        for (Index t = first; t < end; ++t) draw(t);
        for (const Index t : crossing_[node])
            if (t < first || t >= end) draw(t);
    }

    // The mean distance of the ring's other corners from the proxy.
    static float mean_reach(std::span<const RingTriangle> ring, const Point& proxy) {
        float sum = 0;
        int count = 0;
        for (const RingTriangle& t : ring) {
            for (std::size_t k = 0; k < 3; ++k) {
                if ((t.inside >> k) & 1) continue;
                sum += glm::length(t.corner[k].position - proxy.position);
                ++count;
            }
        }
        return count > 0 ? sum / static_cast<float>(count) : 0;
    }

    // Where two such surfaces differ most, they do so at a vertex or where two edges cross: looked at are the middles
    // of the edges that move, and of their halves. The vertices are among the samples.
    static void compare(std::span<const RingTriangle> surface, Surface& with, Difference& worst, Mean& mean) {
        if (with.empty()) return;
        const std::size_t count = std::min(surface.size(), triangles_compared);
        for (std::size_t i = 0; i < count; ++i) {
            const RingTriangle& t = surface[i * surface.size() / count];
            for (std::size_t k = 0; k < 3; ++k) {
                if (!((t.inside >> k) & 1)) continue;
                const Point &a = t.corner[k], &b = t.corner[(k + 1) % 3], middle = middle_of(a, b);
                const Difference here = with.compare(middle);
                worst.include(here);
                mean.include(here);
                worst.include(with.compare(middle_of(a, middle)));
                worst.include(with.compare(middle_of(middle, b)));
            }
        }
    }

    static bool are_distinct(const std::array<NodeId, 3>& nodes) {
        return nodes[0] != nodes[1] && nodes[1] != nodes[2] && nodes[2] != nodes[0];
    }

    static Point middle_of(const Point& a, const Point& b) {
        return {(a.position + b.position) * 0.5f, (a.luminance + b.luminance) * 0.5f};
    }

    void add_samples(NodeId node, Scratch& scratch) const {
        const auto add_leaf = [&](Index leaf, bool is_typical) {
            scratch.samples.push_back({leaf_point(leaf), leaf, is_typical, {}});
        };
        tree_.for_each_child(node, [&](NodeId child) {
            if (tree_.is_leaf(child)) {
                add_leaf(child - interior_, false);
                return;
            }
            scratch.samples.push_back({point(child), none, false, {}});
            for (const Index leaf : witnesses_[child])
                if (leaf != none) add_leaf(leaf, false);
        });
        const Index leaves = leaf_end_[node] - first_leaf_[node];
        const Index count = std::min(spread_count, leaves);
        for (Index i = 0; i < count; ++i)
            add_leaf(first_leaf_[node] + static_cast<Index>((std::uint64_t{leaves} * (2 * i + 1)) / (2 * count)), true);
    }

    void choose_witnesses(NodeId node, std::span<Sample> samples) {
        Witnesses& worst = witnesses_[node];
        worst.fill(none);
        const auto take = [&](std::size_t first, auto error) {
            for (std::size_t k = first; k < first + witness_count / 2; ++k) {
                const Sample* best = nullptr;
                for (const Sample& s : samples)
                    if (s.leaf != none && std::find(worst.begin(), worst.end(), s.leaf) == worst.end() &&
                        (!best || error(s) > error(*best)))
                        best = &s;
                if (best) worst[k] = best->leaf;
            }
        };
        take(0, [](const Sample& s) { return s.error.distance; });
        take(witness_count / 2, [](const Sample& s) { return s.error.luminance; });
    }

    const SoundTree& tree_;
    std::vector<FoldRecord>& records_;
    std::vector<FoldFacing>& facing_;
    std::span<const glm::vec3> positions_;
    std::span<const Unorm16> luminance_;
    std::span<const PackedRange> support_luminance_;
    std::span<const Index> first_leaf_, leaf_end_;
    std::span<const NodeId> parents_;
    std::span<const Index> first_triangle_;
    std::span<const Triangle> triangles_;
    std::span<const Sphere> support_;
    NodeId interior_;
    LeafTriangles of_leaf_;
    std::vector<std::vector<Index>> crossing_; // of nodes whose parent has not been measured yet
    std::vector<Contact> contacts_;
    std::vector<Witnesses> witnesses_;
};

// Lengths in the tree's own units again. False where they are beyond all numbers.
bool scale_back(FoldRecord& record, float scale) {
    if (record.gap < infinity && !std::isfinite(record.gap / scale)) return false;
    for (float* length : {&record.shift, &record.farthest, &record.mean_distance, &record.extent, &record.gap})
        *length /= scale;
    return is_sound(record);
}

// The tree with these attributes, one after the other.
class Attributes {
public:
    explicit Attributes(VertexTree tree) : tree_(std::move(tree)) {}

    template <class T>
    void add(std::string_view name, AttributeDomain domain, std::vector<T> values) {
        if (tree_) tree_ = tree_->with_attribute(name, domain, std::move(values));
    }
    Result<VertexTree> take() { return std::move(tree_); }

private:
    Result<VertexTree> tree_;
};

} // namespace

bool has_fold_measurement(const VertexTree& tree) { return !tree.attribute<FoldRecord>(record_name).empty(); }

std::span<const float> measurement_settings() noexcept { return settings; }

Result<VertexTree> measure_folds(const VertexTree& tree, int threads, const Progress& progress) {
    const auto sound = SoundTree::of(tree);
    if (!sound) return sound.error();
    if (!tree.texture().empty())
        return Error{
            ErrorCode::unsupported,
            "What folds change of a texture is not measured: take another fold test, or the tree without its texture."};
    // Measured is in units in which no product of lengths overflows or vanishes.
    const float scale = unit_scale(tree.bounding_sphere().radius);
    const auto scaled = std::make_shared<VertexTree::Data>(tree.data());
    if (scale != 1) scaled->geometry = scaled_geometry(tree.data().geometry, scale);
    const auto measured = SoundTree::of(VertexTree(scaled));
    if (!measured) return measured.error();

    std::vector<FoldRecord> records(tree.interior_count());
    std::vector<FoldFacing> facing(tree.interior_count());
    std::vector<FoldError> errors;
    std::vector<FoldStage> stages;
    tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
    bool is_whole = false;
    arena.execute([&] {
        is_whole = Measurer(*measured, records, facing).run(progress);
        if (!is_whole) return;
        // How much light many folds shift depends on the order in which they are folded: that of what the model makes
        // of each alone, whatever the factors of a criterion will be.
        errors = nested_errors(*measured, records, facing, FoldModel());
        find_luminance_bias(*measured, errors);
        stages = find_stages(*measured, errors);
    });
    if (!is_whole) return Error{ErrorCode::cancelled, "Measuring what folds change was cancelled."};
    std::vector<std::uint8_t> stage_of(tree.interior_count());
    for (NodeId node = 0; node < errors.size(); ++node) {
        records[node].bias = errors[node].bias;
        facing[node].fading = errors[node].fading;
        stage_of[node] = errors[node].stage;
        if (!scale_back(records[node], scale))
            return Error{ErrorCode::unsupported, "What folding node " + std::to_string(node) +
                                                     " changes is beyond all numbers: the mesh is too large."};
    }
    Attributes with(tree.share());
    with.add(settings_name, AttributeDomain::tree, std::vector<float>(settings.begin(), settings.end()));
    with.add(record_name, AttributeDomain::interior_node, std::move(records));
    with.add(facing_name, AttributeDomain::interior_node, std::move(facing));
    with.add(stage_of_name, AttributeDomain::interior_node, std::move(stage_of));
    with.add(stages_name, AttributeDomain::tree, std::move(stages));
    return with.take();
}

} // namespace unseen::perception
