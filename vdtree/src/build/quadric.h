// Quadrics over position and the channels of attribute classes, in floats, four or eight at a time.
//
// A cluster's quadric is the sum over its triangles of the squared distance from the triangle's plane and, for each
// channel, of the squared difference from the channel's linear function on the triangle:
//
//   E(x, s) = sum w (n.x)^2 + sum_j sum w_j (g_j.x + d_j - s_j)^2
//
// Weighting the second term with 1 / (1 + |g|^2), for the steepest channel of a class, makes it about the squared
// distance in the space of position and channel (Garland and Heckbert 1998), and bounds what slivers contribute. The
// channel values are not stored: the best s for a given x is linear in x (Hoppe 1999), which leaves a form in x alone.
//
// An attribute class (normal, texture coordinates, colour) may have several values at one place, on the two sides of a
// seam. Each is a component of the cluster with a block of its own: only the s differ, so what is known of x is one
// base for all of them.
//
// Positions are relative to the cluster's own place and channel values to its own reference, so floats suffice: what
// is subtracted is never larger than the cluster.
#pragma once

#include <array>

#include <unseen/vdtree/mesh.h>

#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

// Where the numbers of a quadric's base lie, x'Mx + 2 h'x + k and the weight, and those of a channel's row and a
// block's weight: G'x + D - W s is half the derivative by s.
namespace quadric {
enum : std::size_t { xx, xy, xz, yy, yz, zz, hx, hy, hz, k, weight, base_size };
enum : std::size_t { gx, gy, gz, d, row_size };
} // namespace quadric

inline constexpr std::size_t most_classes = 3; // normal, texture coordinates, colour with luminance
inline constexpr std::size_t most_class_channels = 4;
inline constexpr std::size_t most_channels = 3 + 2 + 4;

// Floats of a class's block: the rows of its channels, and its weight.
constexpr std::size_t block_size(std::size_t channels) { return channels * quadric::row_size + 1; }
inline constexpr std::size_t most_block_floats = block_size(most_class_channels);

// The attribute classes of a mesh, by how many channels each has.
struct AttributeClasses {
    std::array<std::uint32_t, most_classes> channels{};
    std::uint32_t count = 0;

    bool operator==(const AttributeClasses&) const = default;
    constexpr std::size_t total_channels() const { return first_channel(count); }
    constexpr std::size_t first_channel(std::size_t c) const {
        std::size_t first = 0;
        for (std::size_t i = 0; i < c; ++i) first += channels[i];
        return first;
    }
    // Where the class's block lies in a quadric that has one of each.
    constexpr std::size_t first_float(std::size_t c) const {
        return quadric::base_size + first_channel(c) * quadric::row_size + c;
    }
    // Floats from one quadric to the next.
    constexpr std::size_t stride() const { return (first_float(count) + 3) / 4 * 4; }
};
// What most meshes have.
inline constexpr AttributeClasses only_normals{{3}, 1}, normals_and_uvs{{3, 2}, 2};
inline constexpr std::size_t most_quadric_floats =
    (quadric::base_size + most_channels * quadric::row_size + most_classes + 3) / 4 * 4;

template <class F>
struct Offset {
    F x, y, z;
};

// sum = a + b, where b's place lies at `to` from a's. F is float or one of the vectors.
template <class F>
UNSEEN_INLINE void add_base(const F* a, const F* b, const Offset<F>& to, F* sum) {
    using namespace quadric;
    const F mx = b[xx] * to.x + b[xy] * to.y + b[xz] * to.z;
    const F my = b[xy] * to.x + b[yy] * to.y + b[yz] * to.z;
    const F mz = b[xz] * to.x + b[yz] * to.y + b[zz] * to.z;
    for (std::size_t i = xx; i <= zz; ++i) sum[i] = a[i] + b[i];
    sum[k] = a[k] + (b[k] + mx * to.x + my * to.y + mz * to.z - 2 * (b[hx] * to.x + b[hy] * to.y + b[hz] * to.z));
    sum[hx] = a[hx] + (b[hx] - mx), sum[hy] = a[hy] + (b[hy] - my), sum[hz] = a[hz] + (b[hz] - mz);
    sum[weight] = a[weight] + b[weight];
}

// The same of a block each, where b's references exceed a's by `raised`; `base`: the sum's.
template <class F>
UNSEEN_INLINE void add_block(const F* a, const F* b, const Offset<F>& to, const F* raised, std::size_t channels, F* sum,
                             F* base) {
    using namespace quadric;
    const F weight_b = b[channels * row_size];
    for (std::size_t c = 0; c < channels; ++c) {
        const F *from = b + c * row_size, *onto = a + c * row_size;
        F* row = sum + c * row_size;
        const F moved = from[d] - (from[gx] * to.x + from[gy] * to.y + from[gz] * to.z), step = raised[c];
        base[hx] += step * from[gx], base[hy] += step * from[gy], base[hz] += step * from[gz];
        base[k] += step * (2 * moved + step * weight_b);
        for (std::size_t i = gx; i <= gz; ++i) row[i] = onto[i] + from[i];
        row[d] = onto[d] + (moved + step * weight_b);
    }
    sum[channels * row_size] = a[channels * row_size] + weight_b;
}

// The same of quadrics with one block of each class. `classes`: a constant where the compiler is to unroll.
template <class F>
UNSEEN_INLINE void add_quadrics(const F* a, const F* b, const Offset<F>& to, const F* raised,
                                const AttributeClasses classes, F* sum) {
    add_base(a, b, to, sum);
    for (std::size_t k = 0; k < classes.count; ++k) {
        const std::size_t first = classes.first_float(k);
        add_block(a + first, b + first, to, raised + classes.first_channel(k), classes.channels[k], sum + first, sum);
    }
}

// The least error by the place, with the best channel values there.
template <class F>
struct Form {
    F xx, xy, xz, yy, yz, zz, hx, hy, hz, k;

    template <class G>
    static UNSEEN_INLINE Form of_base(const G* q) {
        return {F(q[quadric::xx]), F(q[quadric::xy]), F(q[quadric::xz]), F(q[quadric::yy]), F(q[quadric::yz]),
                F(q[quadric::zz]), F(q[quadric::hx]), F(q[quadric::hy]), F(q[quadric::hz]), F(q[quadric::k])};
    }
    template <class G>
    static UNSEEN_INLINE Form of(const Form<G>& f) {
        return {F(f.xx), F(f.xy), F(f.xz), F(f.yy), F(f.yz), F(f.zz), F(f.hx), F(f.hy), F(f.hz), F(f.k)};
    }
    template <class G>
    UNSEEN_INLINE void eliminate(const G* block, std::size_t channels) {
        const F inverse = 1 / F(block[channels * quadric::row_size]);
        for (std::size_t c = 0; c < channels; ++c, block += quadric::row_size) {
            const F x = F(block[quadric::gx]), y = F(block[quadric::gy]), z = F(block[quadric::gz]),
                    d = F(block[quadric::d]);
            const F g0 = x * inverse, g1 = y * inverse, g2 = z * inverse;
            xx -= g0 * x, xy -= g0 * y, xz -= g0 * z, yy -= g1 * y, yz -= g1 * z, zz -= g2 * z;
            hx -= g0 * d, hy -= g1 * d, hz -= g2 * d;
            k -= d * d * inverse;
        }
    }
    // Of a quadric with one block of each class.
    template <class G>
    static UNSEEN_INLINE Form of_all(const G* q, const AttributeClasses classes) {
        Form form = of_base(q);
        for (std::size_t k = 0; k < classes.count; ++k) form.eliminate(q + classes.first_float(k), classes.channels[k]);
        return form;
    }
    UNSEEN_INLINE Offset<F> gradient(const Offset<F>& p) const { // half of it
        return {xx * p.x + xy * p.y + xz * p.z + hx, xy * p.x + yy * p.y + yz * p.z + hy,
                xz * p.x + yz * p.y + zz * p.z + hz};
    }
    UNSEEN_INLINE F operator()(const Offset<F>& p) const {
        const Offset<F> g = gradient(p);
        return k + (g.x + hx) * p.x + (g.y + hy) * p.y + (g.z + hz) * p.z;
    }
};

// Directions in which the form is flatter than this share of its trace have no best place that floats could tell from
// others.
inline constexpr float flat_share = 1e-5f;

// The inverse of the form's matrix plus `lift` on its diagonal.
template <class F>
class LiftedInverse {
public:
    UNSEEN_INLINE LiftedInverse(const Form<F>& f, F lift) {
        const F d0 = f.xx + lift;
        i0_ = 1 / d0;
        l1_ = f.xy * i0_, l2_ = f.xz * i0_;
        const F d1 = f.yy + lift - l1_ * f.xy, cross = f.yz - l1_ * f.xz;
        i1_ = 1 / d1;
        l21_ = cross * i1_;
        i2_ = 1 / (f.zz + lift - l2_ * f.xz - l21_ * cross);
    }
    UNSEEN_INLINE Offset<F> operator()(const Offset<F>& r) const {
        const F y = r.y - l1_ * r.x, z = (r.z - l2_ * r.x - l21_ * y) * i2_;
        const F y2 = y * i1_ - l21_ * z;
        return {r.x * i0_ - l1_ * y2 - l2_ * z, y2, z};
    }

private:
    F i0_, i1_, i2_, l1_, l2_, l21_;
};

template <class F>
struct Minimum {
    Offset<F> at;
    F error;
};

// Where a sum whose parts lie at 0 and `to` is least. In flat directions it stays at the middle of the two. Each step
// minimises the form plus a small weight times the squared distance from the step before. So steep directions are as
// good as exact after few steps, and flat ones have hardly moved. A minimum that is farther from the middle than the
// two are from each other is not trusted: then, and wherever they are better, the middle and the two ends are tried.
template <class F>
UNSEEN_INLINE Minimum<F> minimise(const Form<F>& form, const Offset<F>& to, int steps) {
    constexpr float least_lift = 1e-30f; // where there is no form at all
    const Offset<F> middle{to.x * 0.5f, to.y * 0.5f, to.z * 0.5f};
    const LiftedInverse<F> inverse(form, (form.xx + form.yy + form.zz) * flat_share + least_lift);
    Offset<F> at = middle;
    for (int i = 0; i < steps; ++i) {
        const Offset<F> step = inverse(form.gradient(at));
        at = {at.x - step.x, at.y - step.y, at.z - step.z};
    }
    const F x = at.x - middle.x, y = at.y - middle.y, z = at.z - middle.z;
    const auto near = x * x + y * y + z * z <= to.x * to.x + to.y * to.y + to.z * to.z; // false for NaN too
    at = {near ? at.x : middle.x, near ? at.y : middle.y, near ? at.z : middle.z};
    F error = form(at);
    const F at_end = form(to);
    const auto to_end = at_end < error;
    at = {to_end ? to.x : at.x, to_end ? to.y : at.y, to_end ? to.z : at.z};
    error = to_end ? at_end : error;
    const auto to_begin = form.k < error;
    at = {to_begin ? F{} : at.x, to_begin ? F{} : at.y, to_begin ? F{} : at.z};
    error = to_begin ? form.k : error;
    return {at, error > 0 ? error : F{}};
}

// Moves the place by `to`.
inline void move_base(float* q, const Offset<float>& to) {
    using namespace quadric;
    const float mx = q[xx] * to.x + q[xy] * to.y + q[xz] * to.z;
    const float my = q[xy] * to.x + q[yy] * to.y + q[yz] * to.z;
    const float mz = q[xz] * to.x + q[yz] * to.y + q[zz] * to.z;
    q[k] += mx * to.x + my * to.y + mz * to.z + 2 * (q[hx] * to.x + q[hy] * to.y + q[hz] * to.z);
    q[hx] += mx, q[hy] += my, q[hz] += mz;
}

// After it: the block's part, and its references move to the best values there.
inline void move_block(float* block, const Offset<float>& to, float* references, std::size_t channels, float* base) {
    using namespace quadric;
    const float weight = block[channels * row_size];
    for (std::size_t c = 0; c < channels; ++c, block += row_size) {
        const float there = block[d] + block[gx] * to.x + block[gy] * to.y + block[gz] * to.z;
        const float best = there / weight;
        base[hx] -= best * block[gx], base[hy] -= best * block[gy], base[hz] -= best * block[gz];
        base[k] -= best * there;
        block[d] = 0;
        references[c] += best;
    }
}

} // namespace unseen::vdtree
