// Compares every fold with the surface before it, by points and by small pictures, from the leaves up.
#include <unseen/perception/fold_measurement.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <optional>
#include <string>

#include <glm/geometric.hpp>
#include <tbb/task_arena.h>

#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/scaled_geometry.h>
#include <unseen/vdtree/internal/simd.h>
#include <unseen/vdtree/internal/texture_bounds.h>
#include <unseen/vdtree/internal/texture_pyramid.h>
#include <unseen/vdtree/internal/tree_parts.h>
#include <unseen/vdtree/internal/vertex_tree_data.h>

#include "fold/fold_errors.h"
#include "measure/border_shifts.h"
#include "measure/contacts.h"
#include "measure/find_stages.h"
#include "measure/fold_picture.h"
#include "measure/fold_record.h"
#include "measure/leaf_triangles.h"
#include "measure/luminance_bias.h"
#include "measure/measure_folds.h"
#include "measure/measurement.h"
#include "measure/measuring_progress.h"
#include "measure/texture_density.h"
#include "measure/textured_light.h"

namespace unseen::perception {

using namespace vdtree;
using namespace measurement;

namespace {

constexpr Index none = 0xffffffffu;
constexpr Index leaves_of_part = 4096; // of a subtree that one task measures
constexpr float infinity = std::numeric_limits<float>::infinity();

// `count`: of the luminances that are measured at once.
template <std::size_t count>
struct Difference {
    float distance = 0;
    float slide = 0; // of a texture: texels
    std::array<float, count> luminance = {};

    void include(const Difference& other) {
        distance = std::max(distance, other.distance), slide = std::max(slide, other.slide);
        for (std::size_t i = 0; i < count; ++i) luminance[i] = std::max(luminance[i], other.luminance[i]);
    }
    float largest_luminance() const { return *std::max_element(luminance.begin(), luminance.end()); }
};

// Of a ring, before or after the fold.
template <std::size_t count>
struct RingTriangle {
    LitPointOf<count> corner[3];
    unsigned inside = 0; // a bit for each corner in the support
};

// The directions of normals along the slabs' axes.
class NormalReach {
public:
    template <std::size_t count>
    void insert(const RingTriangle<count>& t) {
        const glm::vec3 a = t.corner[0].position;
        glm::vec3 n = glm::cross(t.corner[1].position - a, t.corner[2].position - a);
        const float squared = glm::dot(n, n);
        if (!(squared > 0)) return;
        n /= std::sqrt(squared);
        const Float4 main = {n.x, n.y, n.z, 0};
        const Float4 diagonal =
            (n.x * Float4{1, -1, 1, 1} + n.y * Float4{1, 1, -1, 1} + n.z * Float4{1, 1, 1, -1}) * inverse_sqrt3;
        low_main_ = low_main_ < main ? low_main_ : main, high_main_ = high_main_ > main ? high_main_ : main;
        low_diagonal_ = low_diagonal_ < diagonal ? low_diagonal_ : diagonal;
        high_diagonal_ = high_diagonal_ > diagonal ? high_diagonal_ : diagonal;
    }

    NormalSlabs slabs() const {
        NormalSlabs slabs;
        if (low_main_[0] > high_main_[0]) return slabs;
        static_assert(NormalSlabs::axis_count == 7); // three axes, four diagonals
        for (std::size_t i = 0; i < NormalSlabs::axis_count; ++i) {
            const float low = i < 3 ? low_main_[i] : low_diagonal_[i - 3];
            const float high = i < 3 ? high_main_[i] : high_diagonal_[i - 3];
            slabs.lo[i] = static_cast<std::int8_t>(std::max(std::floor(low * units - margin), -units));
            slabs.hi[i] = static_cast<std::int8_t>(std::min(std::ceil(high * units + margin), units));
        }
        return slabs;
    }

private:
    static constexpr float inverse_sqrt3 = 0.57735026918962576f, units = 127;
    static constexpr float margin = 1e-3f; // units; a hundred times the rounding of a normal
    Float4 low_main_ = {2, 2, 2, 2}, high_main_ = -low_main_;
    Float4 low_diagonal_ = low_main_, high_diagonal_ = -low_main_;
};

// Points by columns, so that eight at once are compared with a surface, and the nearest points of that surface.
template <std::size_t count>
class Points {
public:
    using Point = LitPointOf<count>;
    static constexpr std::size_t lanes = 8;

    void clear() { points_.clear(); }
    void add(const Point& p) { points_.push_back(p); }
    std::size_t size() const { return points_.size(); }

    // Columns of the points from `first` on; after the last point it is repeated.
    struct alignas(32) Block {
        float x[lanes], y[lanes], z[lanes];
        float squared[lanes], luminance[count][lanes]; // the distance to the nearest point, and its luminances
    };
    std::span<Block> blocks() {
        blocks_.resize((size() + lanes - 1) / lanes);
        for (std::size_t i = 0; i < blocks_.size() * lanes; ++i) {
            const glm::vec3& p = points_[std::min(i, size() - 1)].position;
            Block& to = blocks_[i / lanes];
            to.x[i % lanes] = p.x, to.y[i % lanes] = p.y, to.z[i % lanes] = p.z;
        }
        return blocks_;
    }
    // Once the blocks are compared: the distance to the nearest point, and what is here and there.
    float distance(std::size_t i) const { return std::sqrt(blocks_[i / lanes].squared[i % lanes]); }
    std::array<float, count> here(std::size_t i) const {
        std::array<float, count> all;
        for (std::size_t k = 0; k < count; ++k) all[k] = points_[i].luminance[k];
        return all;
    }
    std::array<float, count> there(std::size_t i) const {
        std::array<float, count> all;
        for (std::size_t k = 0; k < count; ++k) all[k] = blocks_[i / lanes].luminance[k][i % lanes];
        return all;
    }

private:
    std::vector<Point> points_;
    std::vector<Block> blocks_;
};

template <std::size_t count>
class Surface {
public:
    using Block = typename Points<count>::Block;

    void assign(std::span<const RingTriangle<count>> ring) {
        triangles_.clear();
        for (const auto& [corner, inside] : ring) {
            const auto& [a, b, c] = corner;
            const glm::vec3 ab = b.position - a.position, ac = c.position - a.position;
            const float bb = glm::dot(ab, ab), bc = glm::dot(ab, ac), cc = glm::dot(ac, ac);
            const float determinant = bb * cc - bc * bc;
            const float inverse = determinant > least_determinant * bb * cc ? 1 / determinant : 0;
            PreparedTriangle& t = triangles_.emplace_back(PreparedTriangle{a.position,
                                                                           ab,
                                                                           ac,
                                                                           {},
                                                                           {},
                                                                           {},
                                                                           bb,
                                                                           bc,
                                                                           cc,
                                                                           divisor(bb),
                                                                           divisor(cc),
                                                                           divisor(bb - 2 * bc + cc),
                                                                           inverse});
            for (std::size_t i = 0; i < count; ++i) {
                t.luminance[i] = a.luminance[i];
                t.luminance_b[i] = b.luminance[i] - a.luminance[i], t.luminance_c[i] = c.luminance[i] - a.luminance[i];
            }
        }
    }
    bool empty() const { return triangles_.empty(); }

    // How the points differ from the nearest ones of the surface; of equally near ones, those of the first triangle.
    void compare(Points<count>& points) const {
        for (Block& block : points.blocks()) (has_avx2() ? find_avx2 : find_plain)(triangles_, block);
    }

private:
    // Triangles whose area is less than a thousandth of its edges' squares count by their edges.
    static constexpr float least_determinant = 1e-6f;

    struct PreparedTriangle {
        glm::vec3 a, b, c;                                            // b and c from a
        std::array<float, count> luminance, luminance_b, luminance_c; // a's; the others' less that
        float bb, bc, cc;                                             // products
        float along_b, along_c, along_bc;                             // what lengths along the edges are divided by
        float inverse;                                                // of the determinant; 0: only its edges count
    };
    // Of edges without a length, the first end is as near as any.
    static float divisor(float squared) { return squared > 0 ? squared : infinity; }

    // The nearest point a + v b + w c of each triangle: of its inside, where the foot of the perpendicular lies there,
    // or of an edge. `Floats`: a register's.
    template <class Floats>
    static UNSEEN_INLINE void find(std::span<const PreparedTriangle> triangles, Block& points, std::size_t first) {
        const auto load = [&](const float* column, Floats& to)
                              UNSEEN_INLINE_LAMBDA { std::memcpy(&to, column + first, sizeof(Floats)); };
        const auto share = [](const Floats& part, float whole) UNSEEN_INLINE_LAMBDA {
            const Floats s = part / whole, above = s > 0 ? s : Floats{};
            return above < 1 ? above : Floats{} + 1;
        };
        Floats x, y, z, nearest = Floats{} + infinity, nearest_luminance[count] = {};
        load(points.x, x), load(points.y, y), load(points.z, z);
        for (const PreparedTriangle& t : triangles) {
            const Floats px = x - t.a.x, py = y - t.a.y, pz = z - t.a.z;
            const Floats pb = px * t.b.x + py * t.b.y + pz * t.b.z, pc = px * t.c.x + py * t.c.y + pz * t.c.z;
            const Floats v0 = (t.cc * pb - t.bc * pc) * t.inverse, w0 = (t.bb * pc - t.bc * pb) * t.inverse;
            const Floats on_ab = share(pb, t.along_b), on_ac = share(pc, t.along_c),
                         on_bc = share(pc - pb - t.bc + t.bb, t.along_bc), off_bc = 1 - on_bc;
            const Floats cost_ab = on_ab * (on_ab * t.bb - 2 * pb), cost_ac = on_ac * (on_ac * t.cc - 2 * pc),
                         cost_bc =
                             off_bc * (off_bc * t.bb + 2 * on_bc * t.bc - 2 * pb) + on_bc * (on_bc * t.cc - 2 * pc);
            const auto is_ab = cost_ab < cost_ac;
            const auto is_bc = cost_bc < (is_ab ? cost_ab : cost_ac);
            const auto is_inside = (Floats{} + t.inverse > 0) & (v0 >= 0) & (w0 >= 0) & (v0 + w0 <= 1);
            Floats v = is_ab ? on_ab : Floats{}, w = is_ab ? Floats{} : on_ac;
            v = is_bc ? off_bc : v;
            w = is_bc ? on_bc : w;
            v = is_inside ? v0 : v;
            w = is_inside ? w0 : w;
            const Floats dx = px - v * t.b.x - w * t.c.x, dy = py - v * t.b.y - w * t.c.y,
                         dz = pz - v * t.b.z - w * t.c.z;
            const Floats squared = dx * dx + dy * dy + dz * dz;
            const auto is_nearer = squared < nearest;
            nearest = is_nearer ? squared : nearest;
            for (std::size_t i = 0; i < count; ++i) {
                const Floats luminance = t.luminance[i] + v * t.luminance_b[i] + w * t.luminance_c[i];
                nearest_luminance[i] = is_nearer ? luminance : nearest_luminance[i];
            }
        }
        std::memcpy(points.squared + first, &nearest, sizeof(Floats));
        for (std::size_t i = 0; i < count; ++i)
            std::memcpy(points.luminance[i] + first, &nearest_luminance[i], sizeof(Floats));
    }
    static void find_plain(std::span<const PreparedTriangle> triangles, Block& points) {
        for (const std::size_t first : {std::size_t{0}, std::size_t{4}}) find<Float4>(triangles, points, first);
    }
#if defined(UNSEEN_EIGHT_WIDE)
    UNSEEN_AVX2 static void find_avx2(std::span<const PreparedTriangle> triangles, Block& points) {
        find<Float8>(triangles, points, 0);
    }
#else
    static constexpr auto find_avx2 = find_plain;
#endif

    std::vector<PreparedTriangle> triangles_;
};

// Of trees that are the same but for their luminances. Which neighbours are folded with a node depends on these: what a
// light makes of several of them may let as many fold as any of them does, or as few as all do. Both are measured where
// they differ, of all luminances.
//
// Of textured trees, points have their texture coordinates besides, and what is compared is the texture's luminance
// there, times theirs.
template <std::size_t luminances, bool is_textured>
class Measurer {
    static constexpr std::size_t channels = luminances + (is_textured ? 2 : 0), u_channel = luminances,
                                 v_channel = luminances + 1;
    using Point = LitPointOf<channels>;
    using Difference = perception::Difference<luminances>;
    using RingTriangle = perception::RingTriangle<channels>;
    using Points = perception::Points<channels>;
    using Surface = perception::Surface<channels>;
    using FoldPicture = FoldPictureOf<channels>;

public:
    // `contacts`: of the trees.
    Measurer(std::span<const SoundTree> trees, std::span<const TexturedLight> lights, std::span<MeasuredFolds> found,
             std::vector<Contact> contacts)
        : tree_(trees.front()), lights_(lights), found_(found), first_leaf_(tree_.first_leaf()),
          leaf_end_(tree_.leaf_end()), parents_(tree_.parents()), first_triangle_(tree_.first_triangle()),
          triangles_(tree_.triangles()), support_(tree_.support_spheres()), interior_(tree_.interior_count()),
          of_leaf_(tree_), border_(tree_, of_leaf_), crossing_(interior_), contacts_(std::move(contacts)),
          witnesses_(interior_), luminance_span_(interior_), most_changed_(interior_) {
        for (NodeId node = 0; node < interior_; ++node) {
            for (std::size_t i = 0; i < luminances; ++i) {
                const PackedRange support = trees[i].support_luminance()[node];
                luminance_span_[node][i] = support.hi.value - support.lo.value;
            }
            most_changed_[node] = most_changed(node, trees);
        }
        points_.resize(tree_.node_count());
        for (NodeId node = 0; node < tree_.node_count(); ++node) {
            points_[node].position = tree_.positions()[node];
            for (std::size_t i = 0; i < luminances; ++i) points_[node].luminance[i] = trees[i].luminance()[node];
            if constexpr (is_textured) {
                const glm::vec2 uv = tree_.uvs()[node];
                points_[node].luminance[u_channel] = uv.x, points_[node].luminance[v_channel] = uv.y;
            }
        }
        if constexpr (is_textured) {
            densities_.emplace(tree_, *lights_.front().texture);
            TreeParts parts(links_of(*tree_.data().geometry));
            parts.assign_triangles(tree_.first_triangle(), tree_.triangles());
            footprints_ = bound_footprints(*tree_.data().geometry, parts);
        }
    }

    // False where it was cancelled.
    bool run(MeasuringProgress& progress) {
        std::vector<NodeId> parts, above;
        for (NodeId node = 0; node < interior_;) {
            const bool is_part = leaf_end_[node] - first_leaf_[node] <= leaves_of_part;
            (is_part ? parts : above).push_back(node);
            node = is_part ? tree_.subtree_end()[node] : node + 1;
        }
        constexpr NodeId at_once = 64; // nodes between looks at the clock
        parallel_loop(std::size_t{0}, parts.size(), [&](std::size_t i) {
            const NodeId begin = parts[i], end = tree_.subtree_end()[begin];
            Scratch scratch;
            for (NodeId last = end; last > begin && !progress.is_cancelled();) {
                const NodeId first = last - std::min(last - begin, at_once);
                for (NodeId node = last; node-- > first;) measure(node, scratch);
                progress.add(last - first);
                last = first;
            }
        });
        Scratch scratch;
        for (std::size_t i = above.size(); i-- > 0 && progress.add(1);) measure(above[i], scratch);
        return !progress.is_cancelled();
    }

private:
    struct Mean {
        Difference sum;
        int count = 0;
        void include(const Difference& other) {
            sum.distance += other.distance, sum.slide += other.slide;
            for (std::size_t i = 0; i < luminances; ++i) sum.luminance[i] += other.luminance[i];
            ++count;
        }
        Difference value() const {
            const float share = 1 / static_cast<float>(std::max(count, 1));
            Difference mean{sum.distance * share, sum.slide * share, sum.luminance};
            for (float& luminance : mean.luminance) luminance *= share;
            return mean;
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
        Points points;
        std::vector<Sample> samples;
        std::vector<NodeId> shown, shown_before; // corners of the crossing triangles: now, and as measured before
        std::vector<Child> children;
        std::array<FoldPicture, picture_sizes.size()> pictures;
        bool compares_fine = false; // the fine ones are few enough, and others
        // With a texture:
        TextureDensity density;
        std::array<std::size_t, picture_sizes.size()> level = {}; // that pictures show
        std::array<typename FoldPicture::BandCells, picture_sizes.size()> weights;
        float middle = 1; // of the texture's luminance in the ring
        float slide = 0;  // texels, as pictures show it, in the mean over some cells

        void clear() {
            for (auto* surface : {&before, &after, &fine_before, &fine_after}) surface->clear();
            shown.clear();
            children.clear();
        }
    };
    using Witnesses = std::array<Index, witness_count>;

    const Point& point(NodeId node) const { return points_[node]; }
    const Point& leaf_point(Index leaf) const { return point(interior_ + leaf); }

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

    // What a fold inside the surface can change at most, but for a factor: luminance times area, and heights. Neither
    // falls from a node to its parent.
    struct Change {
        std::array<float, luminances> light = {};
        float height = 0;
    };
    Change most_changed(NodeId node, std::span<const SoundTree> trees) const {
        const NormalSlabs& normals = tree_.bounds()[node].slabs;
        int turn = 0; // by which the normals differ
        for (std::size_t i = 0; i < NormalSlabs::axis_count; ++i) turn = std::max(turn, normals.hi[i] - normals.lo[i]);
        const float radius = support_[node].radius;
        Change change{{}, static_cast<float>(turn) * radius};
        for (std::size_t i = 0; i < luminances; ++i) {
            const PackedRange luminance = trees[i].ring_luminance()[node];
            change.light[i] = static_cast<float>(luminance.hi.value - luminance.lo.value) * radius * radius;
        }
        return change;
    }
    bool changes_much_less(NodeId a, NodeId node, std::size_t luminance) const {
        const Change &less = most_changed_[a], &more = most_changed_[node];
        return much_less * less.light[luminance] <= more.light[luminance] && much_less * less.height <= more.height &&
               !(tree_.bounds()[a].flags & irregular_ring); // whose border may move as far as it likes
    }
    bool supports(NodeId a, NodeId b) const { return first_leaf_[a] <= first_leaf_[b] && leaf_end_[b] <= leaf_end_[a]; }

    // What stands for a leaf outside the node when it folds: nodes up to its size are folded, as far as they have no
    // more to hide, and those that are hardly seen to fold at any size, as the faces beside an edge. So says each of
    // the luminances; any of them may, or all do.
    enum class Says { any, all };
    NodeId stand_in(Index leaf, NodeId node, Says says) const {
        NodeId at = interior_ + leaf;
        const auto folds_earlier = [&](NodeId up) {
            const bool is_smaller = is_larger(node, up);
            for (std::size_t i = 0; i < luminances; ++i) {
                const bool so = (is_smaller && luminance_span_[up][i] <= much_more * luminance_span_[node][i]) ||
                                (changes_much_less(up, node, i) && !supports(up, node));
                if (so == (says == Says::any)) return so;
            }
            return says == Says::all;
        };
        int steps = 0;
        for (NodeId up = parents_[at]; up != no_node && folds_earlier(up) && ++steps <= most_steps; up = parents_[at])
            at = up;
        return at;
    }

    void measure(NodeId node, Scratch& scratch) {
        crossing_[node] = crossing(node);
        scratch.samples.clear();
        add_samples(node, scratch);
        FoldFacing facing;
        facing.is_height_field = 1;
        FoldRecord record;
        std::array<FoldRecord, luminances> records; // of the luminances alone
        if constexpr (is_textured) found_[0].textures[node] = {};
        measure(node, Says::any, scratch, record, records, facing);
        if constexpr (luminances > 1) {
            scratch.shown_before.swap(scratch.shown);
            measure(node, Says::all, scratch, record, records, facing);
        }
        choose_witnesses(node, scratch.samples);
        record.gap = contacts_[node].gap, record.sine = contacts_[node].sine;
        for (std::size_t i = 0; i < luminances; ++i) {
            FoldRecord& own = found_[i].folds[node];
            own = record;
            own.largest_luminance = records[i].largest_luminance, own.mean_luminance = records[i].mean_luminance;
            std::memcpy(own.amplitudes, records[i].amplitudes, sizeof own.amplitudes);
            found_[i].facing[node] = facing;
            if constexpr (is_textured) found_[i].textures[node] = found_[0].textures[node];
        }
    }

    // Raises what was found before. Does nothing where all neighbours are as they were then.
    void measure(NodeId node, Says says, Scratch& scratch, FoldRecord& record,
                 std::span<FoldRecord, luminances> records, FoldFacing& facing) {
        const NormalSlabs turned = lay_out(node, says, scratch).slabs();
        if (says == Says::all && scratch.shown == scratch.shown_before) return;
        facing.facing |= turned;
        const Point proxy = point(node);
        if (scratch.after.empty()) scratch.after.push_back({{proxy, proxy, proxy}, 7}); // all of it vanishes
        const auto raise = [](float& to, float value) { to = std::max(to, value); };
        const float extent = mean_reach(scratch.after, proxy) / 2, width = std::max(support_[node].radius, extent);
        if constexpr (is_textured) look_at_texture(node, width, scratch);
        Difference worst;
        const Difference mean = compare_surfaces(scratch, worst);
        raise(record.farthest, worst.distance), raise(record.mean_distance, mean.distance);
        raise(record.extent, extent);
        raise(record.border,
              border_.shift(node, crossing_[node], [&](Index leaf) { return stand_in(leaf, node, says); }));
        for (std::size_t i = 0; i < luminances; ++i)
            raise(records[i].largest_luminance, worst.luminance[i]),
                raise(records[i].mean_luminance, mean.luminance[i]);
        const bool is_shown = draw(node, scratch, width, record, records);
        facing.is_height_field &= is_shown;
        if constexpr (is_textured) {
            if (!is_shown || tree_.bounds()[node].ring.radius > longest_shown * width)
                scratch.slide = std::max(scratch.slide, worst.slide);
            find_detail(node, width, scratch, record);
        }
    }

    // ---- with a texture

    // What the measurement of a node needs to know of the texture there.
    void look_at_texture(NodeId node, float width, Scratch& scratch) const {
        scratch.density = densities_->of(node, crossing_[node]);
        for (std::size_t size = 0; size < picture_sizes.size(); ++size) {
            const float cell = 2 * picture_sizes[size] * width / static_cast<float>(picture_side);
            scratch.level[size] = lights_.front().texture->level_of(scratch.density.most * cell);
        }
        const LuminanceRange range = tree_.ring_texture()[node];
        scratch.middle = (range.lo + range.hi) / 2;
        scratch.slide = 0;
    }
    // By how much contrasts over a local mean of the texture are more than those over the middle of its range, by which
    // a criterion divides.
    static float over_local_mean(float middle, float local_mean) {
        return std::max(1.0f, (middle + FoldStage::black) / (local_mean + FoldStage::black));
    }
    float slide_between(float u0, float v0, float u1, float v1) const {
        const glm::vec2 size = lights_.front().texture->size();
        const float slide = std::max(std::abs(u1 - u0) * size.x, std::abs(v1 - v0) * size.y);
        return std::min(slide, std::max(size.x, size.y));
    }

    // Makes the luminances of a picture those that the texture leaves of them.
    void shade(FoldPicture& picture, typename FoldPicture::Layer layer, std::size_t level,
               typename FoldPicture::Cells* textures) const {
        typename FoldPicture::Picture& of = picture.picture(layer);
        for (std::size_t cell = 0; cell < of.height.size(); ++cell) {
            if (textures) (*textures)[cell] = 0;
            if (!FoldPicture::is_seen(of.height[cell])) continue;
            const float texture =
                lights_.front().texture->at(level, {of.luminance[u_channel][cell], of.luminance[v_channel][cell]});
            for (std::size_t i = 0; i < luminances; ++i)
                of.luminance[i][cell] = lights_[i].with_texture(of.luminance[i][cell], texture);
            if (textures) (*textures)[cell] = texture;
        }
    }
    // Of the mesh's pictures, once they are drawn.
    void begin_textured_pictures(Scratch& scratch) const {
        for (std::size_t size = 0; size < scratch.pictures.size(); ++size) {
            FoldPicture& picture = scratch.pictures[size];
            typename FoldPicture::Cells textures;
            shade(picture, FoldPicture::Layer::mesh, scratch.level[size], &textures);
            picture.find_means(FoldPicture::Layer::mesh, textures, scratch.weights[size]);
            for (typename FoldPicture::Cells& of_band : scratch.weights[size])
                for (float& weight : of_band) weight = weight >= 0 ? over_local_mean(scratch.middle, weight) : 1.0f;
        }
    }
    // Of the folded surface's.
    void finish_textured_picture(FoldPicture& picture, std::size_t size, Scratch& scratch) const {
        const auto &mesh = picture.picture(FoldPicture::Layer::mesh),
                   &folded = picture.picture(FoldPicture::Layer::folded);
        typename FoldPicture::Cells slides;
        for (std::size_t cell = 0; cell < slides.size(); ++cell) {
            const bool are_seen = FoldPicture::is_seen(mesh.height[cell]) && FoldPicture::is_seen(folded.height[cell]);
            slides[cell] = are_seen
                               ? slide_between(mesh.luminance[u_channel][cell], mesh.luminance[v_channel][cell],
                                               folded.luminance[u_channel][cell], folded.luminance[v_channel][cell])
                               : 0.0f;
        }
        scratch.slide = std::max(scratch.slide, picture.largest_mean(slides));
        shade(picture, FoldPicture::Layer::folded, scratch.level[size], nullptr);
    }

    // What the texture's detail changes: what is finer than the pictures' cells by sliding over the surface, and all of
    // it by the surface's shift, seen from aside.
    void find_detail(NodeId node, float width, const Scratch& scratch, const FoldRecord& record) {
        const TextureDetail& texture = *lights_.front().texture;
        UvBox box;
        for (const auto* surface : {&scratch.before, &scratch.after, &scratch.fine_before, &scratch.fine_after})
            for (const RingTriangle& t : *surface)
                for (const Point& p : t.corner) box.include({p.luminance[u_channel], p.luminance[v_channel]});
        box.include(footprints_[node]);
        const bool is_dense = scratch.density.least > 0 && std::isfinite(scratch.density.most);
        const float height = std::max(record.shift, record.mean_distance);
        const float aside = height > 0 ? height * scratch.density.most : 0.0f;
        FoldTexture& found = found_[0].textures[node];
        found.mean = scratch.density.mean;
        const float slide_in_widths = is_dense ? scratch.slide / (scratch.density.least * width) : 1.0f;
        found.slide = std::max(found.slide, slide_in_widths < 1 ? slide_in_widths : 1.0f);
        const std::size_t measured_from = *std::min_element(scratch.level.begin(), scratch.level.end());
        for (std::size_t level = 0; level < texture.level_count(); ++level) {
            const float texel = std::exp2(static_cast<float>(level)); // in the texture's own
            const float wave = is_dense ? texels_of_wave * texel / scratch.density.least : 0.0f;
            if (level >= measured_from && wave > 2 * width) break; // as the ring's range shows it
            const float slide = aside + (level < measured_from ? scratch.slide : 0.0f);
            if (!(slide > 0)) continue;
            const float contrast = 2 * std::min(1.0f, slide / texel) * texture.contrast(level, box);
            const float octaves = wave > 0 ? std::floor(std::log2(width / wave)) : 0.0f;
            const auto finer =
                static_cast<std::size_t>(std::clamp(octaves, 0.0f, static_cast<float>(texture_octaves - 1)));
            found.contrast[finer] = std::max(found.contrast[finer], std::min(contrast, most_texture_contrast));
        }
    }

    // ---- the surfaces

    // Puts the ring before and after the fold, coarse and fine, into `scratch`; returns what its triangles face.
    NormalReach lay_out(NodeId node, Says says, Scratch& scratch) {
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
                shown[k] = is_here ? node : stand_in(leaf, node, says);
                shown_before[k] = is_here ? child_of(leaf) : shown[k];
            }
            before.inside = after.inside = whole.inside;
            for (std::size_t k = 0; k < 3; ++k) {
                before.corner[k] = point(shown_before[k]);
                after.corner[k] = point(shown[k]);
            }
            scratch.shown.insert(scratch.shown.end(), shown.begin(), shown.end());
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

    Difference difference(const Points& points, std::size_t i, const Scratch& scratch) const {
        Difference found{points.distance(i), 0, {}};
        const auto here = points.here(i), there = points.there(i);
        if constexpr (is_textured) {
            const TextureDetail& texture = *lights_.front().texture;
            found.slide = slide_between(here[u_channel], here[v_channel], there[u_channel], there[v_channel]);
            const float t0 = texture.at(scratch.level[0], {here[u_channel], here[v_channel]}),
                        t1 = texture.at(scratch.level[0], {there[u_channel], there[v_channel]});
            const float weight = over_local_mean(scratch.middle, (t0 + t1) / 2);
            for (std::size_t k = 0; k < luminances; ++k)
                found.luminance[k] =
                    weight * std::abs(lights_[k].with_texture(here[k], t0) - lights_[k].with_texture(there[k], t1));
        } else {
            for (std::size_t k = 0; k < luminances; ++k) found.luminance[k] = std::abs(here[k] - there[k]);
        }
        return found;
    }

    // Raises the worst errors to those between the surfaces; returns the mean ones.
    Difference compare_surfaces(Scratch& scratch, Difference& worst) {
        scratch.before_surface.assign(scratch.before);
        scratch.after_surface.assign(scratch.after);
        Mean over_leaves, over_before, over_after;
        scratch.points.clear();
        for (const Sample& sample : scratch.samples) scratch.points.add(sample.point);
        scratch.after_surface.compare(scratch.points);
        for (std::size_t i = 0; i < scratch.samples.size(); ++i) {
            Sample& sample = scratch.samples[i];
            const Difference error = difference(scratch.points, i, scratch);
            sample.error.include(error);
            worst.include(error);
            if (sample.is_typical) over_leaves.include(error);
        }
        compare(scratch.before, scratch.after_surface, scratch, worst, over_before);
        compare(scratch.after, scratch.before_surface, scratch, worst, over_after);
        Difference mean = over_leaves.value();
        mean.include(over_before.value());
        mean.include(over_after.value());
        scratch.compares_fine =
            scratch.fine_before.size() <= most_fine_triangles &&
            !(are_equal(scratch.before, scratch.fine_before) && are_equal(scratch.after, scratch.fine_after));
        if (scratch.compares_fine) {
            Mean over_fine_before, over_fine_after;
            scratch.before_surface.assign(scratch.fine_before);
            scratch.after_surface.assign(scratch.fine_after);
            compare(scratch.fine_before, scratch.after_surface, scratch, worst, over_fine_before);
            compare(scratch.fine_after, scratch.before_surface, scratch, worst, over_fine_after);
            mean.include(over_fine_before.value());
            mean.include(over_fine_after.value());
        }
        return mean;
    }

    // Compares pictures of the mesh with those of the folded surface: with folded neighbours, and with none folded.
    // Returns whether nothing is hidden under something else.
    bool draw(NodeId node, Scratch& scratch, float width, FoldRecord& record,
              std::span<FoldRecord, luminances> records) const {
        glm::vec3 normal(0);
        for (const RingTriangle& t : scratch.after) {
            const glm::vec3 a = t.corner[0].position;
            normal += glm::cross(t.corner[1].position - a, t.corner[2].position - a);
        }
        const float length = glm::length(normal);
        if (!(length > 0) || !(width > 0)) return false;
        std::array<FoldPicture, picture_sizes.size()>& pictures = scratch.pictures;
        for (std::size_t size = 0; size < pictures.size(); ++size)
            pictures[size].look(points_[node].position, normal / length, picture_sizes[size] * width);
        draw_mesh(node, scratch);
        if constexpr (is_textured) begin_textured_pictures(scratch);
        const auto compare = [&](std::span<const RingTriangle> folded) {
            for (FoldPicture& picture : pictures) picture.clear(FoldPicture::Layer::folded);
            for (const RingTriangle& t : folded) draw(FoldPicture::Layer::folded, t.corner, pictures);
            for (std::size_t size = 0; size < pictures.size(); ++size) {
                if constexpr (is_textured) finish_textured_picture(pictures[size], size, scratch);
                const typename FoldPicture::Difference difference =
                    pictures[size].difference(luminances, is_textured ? &scratch.weights[size] : nullptr);
                record.shift = std::max(record.shift, difference.shift);
                for (std::size_t i = 0; i < luminances; ++i)
                    for (std::size_t band = 0; band < picture_bands; ++band) {
                        float& amplitude = records[i].amplitudes[size][band];
                        amplitude = std::max(amplitude, difference.amplitudes[i][band]);
                    }
            }
        };
        compare(scratch.after);
        if (scratch.compares_fine) compare(scratch.fine_after);
        return std::all_of(pictures.begin(), pictures.end(),
                           [](const FoldPicture& picture) { return picture.is_height_field(); });
    }

    static void draw(typename FoldPicture::Layer layer, const Point (&corner)[3], std::span<FoldPicture> pictures) {
        const auto a = pictures[0].place(corner[0]), b = pictures[0].place(corner[1]), c = pictures[0].place(corner[2]);
        for (FoldPicture& picture : pictures) picture.draw(layer, a, b, c);
    }

    // The mesh around the support.
    void draw_mesh(NodeId node, Scratch& scratch) const {
        const auto draw_own = [&](Index t) {
            const Triangle& corners = triangles_[t];
            const Point own[3] = {leaf_point(corners[0]), leaf_point(corners[1]), leaf_point(corners[2])};
            draw(FoldPicture::Layer::mesh, own, scratch.pictures);
        };
        const Index first = first_triangle_[node],
                    end = first_triangle_[tree_.subtree_end()[node]]; // those that vanish in the support
        if (end - first > most_triangles_drawn) {
            for (const RingTriangle& t : scratch.before) draw(FoldPicture::Layer::mesh, t.corner, scratch.pictures);
            return;
        }
        for (Index t = first; t < end; ++t) draw_own(t);
        for (const Index t : crossing_[node])
            if (t < first || t >= end) draw_own(t);
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
    void compare(std::span<const RingTriangle> surface, const Surface& with, Scratch& scratch, Difference& worst,
                 Mean& mean) const {
        Points& points = scratch.points;
        if (with.empty()) return;
        points.clear();
        const std::size_t count = std::min(surface.size(), triangles_compared);
        for (std::size_t i = 0; i < count; ++i) {
            const RingTriangle& t = surface[i * surface.size() / count];
            for (std::size_t k = 0; k < 3; ++k) {
                if (!((t.inside >> k) & 1)) continue;
                const Point &a = t.corner[k], &b = t.corner[(k + 1) % 3], middle = middle_of(a, b);
                points.add(middle);
                points.add(middle_of(a, middle));
                points.add(middle_of(middle, b));
            }
        }
        with.compare(points);
        for (std::size_t i = 0; i < points.size(); ++i) {
            const Difference here = difference(points, i, scratch);
            worst.include(here);
            if (i % 3 == 0) mean.include(here);
        }
    }

    static bool are_equal(std::span<const RingTriangle> a, std::span<const RingTriangle> b) {
        return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const RingTriangle& s, const RingTriangle& t) {
            return std::equal(s.corner, s.corner + 3, t.corner, [](const Point& p, const Point& q) {
                return p.position == q.position && std::ranges::equal(p.luminance, q.luminance);
            });
        });
    }

    static bool are_distinct(const std::array<NodeId, 3>& nodes) {
        return nodes[0] != nodes[1] && nodes[1] != nodes[2] && nodes[2] != nodes[0];
    }

    static Point middle_of(const Point& a, const Point& b) {
        constexpr std::size_t registers = sizeof(Point) / sizeof(Float4);
        Float4 p[registers], q[registers];
        std::memcpy(p, &a, sizeof p);
        std::memcpy(q, &b, sizeof q);
        for (std::size_t i = 0; i < registers; ++i) p[i] = (p[i] + q[i]) * 0.5f;
        Point middle;
        std::memcpy(&middle, p, sizeof middle);
        return middle;
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
        take(witness_count / 2, [](const Sample& s) { return s.error.largest_luminance(); });
    }

    // FoldModel::longest_ring is no less by default.
    static constexpr float longest_shown = 4;
    // Of a level's detail: the lowest frequency that it has much of.
    static constexpr float texels_of_wave = 4;

    const SoundTree& tree_;
    std::span<const TexturedLight> lights_; // by tree, with a texture
    std::span<MeasuredFolds> found_;        // by tree
    std::vector<Point> points_;             // of nodes
    std::span<const Index> first_leaf_, leaf_end_;
    std::span<const NodeId> parents_;
    std::span<const Index> first_triangle_;
    std::span<const Triangle> triangles_;
    std::span<const Sphere> support_;
    NodeId interior_;
    LeafTriangles of_leaf_;
    BorderShifts border_;
    std::vector<std::vector<Index>> crossing_; // of nodes whose parent has not been measured yet
    std::vector<Contact> contacts_;
    std::vector<Witnesses> witnesses_;
    std::vector<std::array<int, luminances>> luminance_span_; // by interior node: of its support
    std::vector<Change> most_changed_;                        // likewise
    std::optional<TextureDensities> densities_;               // with a texture
    std::vector<UvBox> footprints_;                           // likewise
};

// Lengths in the tree's own units again. False where they are beyond all numbers.
void scale_lengths(FoldRecord& record, float scale) {
    for (float* length :
         {&record.shift, &record.farthest, &record.mean_distance, &record.extent, &record.gap, &record.border})
        *length *= scale;
}

bool scale_back(FoldRecord& record, float scale) {
    if (record.gap < infinity && !std::isfinite(record.gap / scale)) return false;
    scale_lengths(record, 1 / scale);
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

namespace {

// The colour that all vertices have but for their brightness; none where they have several. Black ones have any.
std::optional<glm::vec3> common_tint(const VertexTree& tree) {
    constexpr float alike = 1e-3f; // of channels, over the luminance: far less than a texture's luminance is wrong by
    std::optional<glm::vec3> tint;
    for (const glm::vec4& colour : tree.colours()) {
        const glm::vec3 rgb(colour);
        const auto luminance = static_cast<float>(rec709_luminance(glm::dvec3(rgb)));
        if (!(luminance > 0)) continue;
        const glm::vec3 own = rgb / luminance;
        if (!tint) tint = own;
        for (int k = 0; k < 3; ++k)
            if (!(std::abs(own[k] - (*tint)[k]) <= alike)) return std::nullopt;
    }
    return tint ? *tint : glm::vec3(1);
}

} // namespace

Result<std::shared_ptr<const TextureDetail>> texture_detail_of(const VertexTree& tree) {
    if (tree.texture().empty()) return std::shared_ptr<const TextureDetail>();
    const auto tint = common_tint(tree);
    if (!tint)
        return Error{ErrorCode::unsupported, "What folds change of a texture over vertices of several hues is not "
                                             "measured: take another fold test, or the tree without its texture."};
    return std::make_shared<const TextureDetail>(tree.texture(), *tint);
}

bool knows_texture(const VertexTree& tree) { return tree.texture().empty() || common_tint(tree).has_value(); }

bool has_fold_measurement(const VertexTree& tree) { return !tree.attribute<FoldRecord>(record_name).empty(); }

std::span<const float> measurement_settings() noexcept { return settings; }

namespace {

// The tree in units in which no product of lengths overflows or vanishes. `geometry`: kept for others of the same one.
Result<SoundTree> in_units(const VertexTree& tree, float scale, std::shared_ptr<const TreeGeometry>& geometry) {
    auto sound = SoundTree::of(tree);
    if (!sound || scale == 1) return sound;
    if (!geometry) geometry = scaled_geometry(tree.data().geometry, scale);
    const auto scaled = std::make_shared<VertexTree::Data>(tree.data());
    scaled->geometry = geometry;
    return SoundTree::of(VertexTree(scaled));
}

Error cancelled_error() { return {ErrorCode::cancelled, "Measuring what folds change was cancelled."}; }

// Of trees that are the same but for their luminances, with what follows from each.
struct Measured {
    std::vector<MeasuredFolds> found;           // by tree
    std::vector<std::vector<FoldError>> errors; // likewise, in the units that were measured in
    std::vector<SoundTree> in_units;            // the trees in these
    std::shared_ptr<const TextureDetail> texture;
    std::vector<TexturedLight> lights; // by tree
};

template <std::size_t luminances, bool is_textured>
bool measure_all(std::span<const SoundTree> trees, std::span<const TexturedLight> lights,
                 std::span<MeasuredFolds> found, double up_to, MeasuringProgress& progress) {
    constexpr double contacts_done = 0.2; // of it
    progress.begin(contacts_done * up_to, static_cast<double>(trees.front().triangles().size()));
    std::vector<Contact> contacts = find_contacts(trees, progress);
    progress.begin(up_to, trees.front().interior_count());
    return Measurer<luminances, is_textured>(trees, lights, found, std::move(contacts)).run(progress);
}

// Without shifts of the mean. `dark`: of textured trees, by tree, what their luminance is where the texture is black. `up_to`: the share of the
// whole that this is.
Result<Measured> measure(std::span<const VertexTree> trees, std::span<const float> dark, int threads, double up_to,
                         MeasuringProgress& progress) {
    const bool is_textured = !trees.front().texture().empty();
    assert(trees.size() == 1 || trees.size() == 4 || (trees.size() == 3 && !is_textured));
    Measured all;
    const float scale = unit_scale(trees.front().bounding_sphere().radius);
    std::shared_ptr<const TreeGeometry> geometry;
    for (const VertexTree& tree : trees) {
        auto measured = in_units(tree, scale, geometry);
        if (!measured) return measured.error();
        all.in_units.push_back(std::move(*measured));
    }
    const NodeId nodes = trees.front().interior_count();
    all.found.resize(trees.size());
    for (MeasuredFolds& found : all.found) {
        found.folds.resize(nodes), found.facing.resize(nodes);
        if (is_textured) found.textures.resize(nodes);
    }
    all.errors.resize(trees.size());
    auto texture = texture_detail_of(trees.front());
    if (!texture) return texture.error();
    all.texture = std::move(*texture);
    for (std::size_t i = 0; i < trees.size(); ++i) all.lights.push_back({all.texture.get(), dark[i]});
    const auto measure_these = is_textured         ? (trees.size() == 1 ? measure_all<1, true> : measure_all<4, true>)
                               : trees.size() == 1 ? measure_all<1, false>
                               : trees.size() == 3 ? measure_all<3, false>
                                                   : measure_all<4, false>;
    tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
    bool is_whole = false;
    arena.execute([&] {
        is_whole = measure_these(all.in_units, all.lights, all.found, up_to, progress);
        if (!is_whole) return;
        parallel_loop(std::size_t{0}, trees.size(), [&](std::size_t i) {
            const MeasuredFolds& found = all.found[i];
            all.errors[i] = nested_errors(all.in_units[i], found.folds, found.facing, found.textures, FoldModel());
        });
    });
    if (!is_whole) return cancelled_error();
    for (MeasuredFolds& found : all.found)
        for (NodeId node = 0; node < nodes; ++node)
            if (!scale_back(found.folds[node], scale))
                return Error{ErrorCode::unsupported, "What folding node " + std::to_string(node) +
                                                         " changes is beyond all numbers: the mesh is too large."};
    return all;
}

constexpr double before_stages = 0.8; // of the whole

void copy_bias(std::span<const FoldError> errors, MeasuredFolds& to) {
    for (std::size_t node = 0; node < errors.size(); ++node) {
        to.folds[node].bias = errors[node].bias;
        to.facing[node].fading = errors[node].fading;
    }
}

std::vector<std::uint8_t> stages_of(std::span<const FoldError> errors) {
    std::vector<std::uint8_t> stage_of(errors.size());
    for (std::size_t node = 0; node < errors.size(); ++node) stage_of[node] = errors[node].stage;
    return stage_of;
}

// What folds change under light from everywhere, as far as the order goes in which they fold: half as much along each
// axis as a light from there.
std::vector<FoldError> errors_in_any_light(const Measured& measured, float to_light) {
    std::vector<FoldError> errors = measured.errors.front();
    for (std::size_t i = 0; i < measured.errors.size(); ++i) {
        const float factor = i < 3 ? to_light / 2 : 1;
        for (std::size_t node = 0; node < errors.size(); ++node) {
            const FoldError& of = measured.errors[i][node];
            errors[node].mean_distance = std::max(errors[node].mean_distance, of.mean_distance);
            const auto include = [&](float& to, float value) {
                to = i == 0 ? factor * value : std::max(to, factor * value);
            };
            include(errors[node].luminance, of.luminance);
            include(errors[node].wide_luminance, of.wide_luminance);
        }
    }
    return errors;
}

} // namespace

Result<VertexTree> measure_folds(const VertexTree& tree, int threads, const Progress& progress) {
    MeasuringProgress told(progress);
    constexpr float dark = 0;
    auto measured = measure(std::span(&tree, 1), std::span(&dark, 1), threads, before_stages, told);
    if (!measured) return measured.error();
    std::vector<FoldError>& errors = measured->errors.front();
    std::vector<FoldStage> stages;
    tbb::task_arena(threads > 0 ? threads : tbb::task_arena::automatic).execute([&] {
        find_luminance_bias(measured->in_units.front(), measured->lights.front(), measured->found.front().textures,
                            errors);
        copy_bias(errors, measured->found.front());
        stages = find_stages(measured->in_units.front(), measured->lights.front(), measured->found.front().textures,
                             errors, told);
    });
    if (told.is_cancelled()) return cancelled_error();
    return with_records(tree, std::move(measured->found.front()), stages_of(errors), std::move(stages));
}

Result<MeasuredShadings> measure_shadings(const VertexTree& tree, std::span<const Shading> shadings,
                                          std::span<const float> dark, float to_light, int threads,
                                          const Progress& progress) {
    std::vector<VertexTree> shaded;
    for (const Shading& luminance : shadings) {
        auto as_shaded = tree.shaded(luminance, !tree.texture().empty());
        if (!as_shaded) return as_shaded.error();
        shaded.push_back(std::move(*as_shaded));
    }
    MeasuringProgress told(progress);
    auto measured = measure(shaded, dark, threads, before_stages, told);
    if (!measured) return measured.error();
    std::vector<FoldError> errors = errors_in_any_light(*measured, to_light);
    MeasuredShadings all;
    tbb::task_arena(threads > 0 ? threads : tbb::task_arena::automatic).execute([&] {
        all.stages = find_lit_stages(measured->in_units.front(), {measured->texture.get(), 0},
                                     measured->found.front().textures, errors, told);
    });
    if (told.is_cancelled()) return cancelled_error();
    all.stage_of = stages_of(errors);
    all.of = std::move(measured->found);
    return all;
}

Result<void> add_luminance_bias(const VertexTree& tree, const TextureDetail* texture, MeasuredFolds& measured) {
    const float scale = unit_scale(tree.bounding_sphere().radius);
    std::shared_ptr<const TreeGeometry> geometry;
    const auto measured_in = in_units(tree, scale, geometry);
    if (!measured_in) return measured_in.error();
    std::vector<FoldRecord> records = measured.folds;
    for (FoldRecord& record : records) scale_lengths(record, scale);
    auto errors = nested_errors(*measured_in, records, measured.facing, measured.textures, FoldModel());
    find_luminance_bias(*measured_in, {texture, 0}, measured.textures, errors);
    copy_bias(errors, measured);
    return {};
}

Result<VertexTree> with_records(const VertexTree& tree, MeasuredFolds measured, std::vector<std::uint8_t> stage_of,
                                std::vector<FoldStage> stages) {
    Attributes with(tree.share());
    with.add(settings_name, AttributeDomain::tree, std::vector<float>(settings.begin(), settings.end()));
    with.add(record_name, AttributeDomain::interior_node, std::move(measured.folds));
    with.add(facing_name, AttributeDomain::interior_node, std::move(measured.facing));
    if (!measured.textures.empty())
        with.add(texture_name, AttributeDomain::interior_node, std::move(measured.textures));
    with.add(stage_of_name, AttributeDomain::interior_node, std::move(stage_of));
    with.add(stages_name, AttributeDomain::tree, std::move(stages));
    return with.take();
}

} // namespace unseen::perception
