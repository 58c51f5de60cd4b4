// Quadrics over position and any number of attribute channels, in floats, four or eight at a time.
//
// A cluster's quadric is the sum over its triangles of the squared distance from the triangle's plane and, for each
// channel, of the squared difference from the channel's linear function on the triangle:
//
//   E(x, s) = sum w (n.x)^2 + sum_j sum w_j (g_j.x + d_j - s_j)^2
//
// Weighting the second term with 1 / (1 + |g|^2) makes it, for one channel, the squared distance in the space of
// position and channel (Garland and Heckbert 1998), and bounds what slivers contribute. The channel values are not
// stored: the best s for a given x is linear in x (Hoppe 1999), which leaves a form in x alone.
//
// Positions are relative to the cluster's own place and channel values to its own reference, so floats suffice: what
// is subtracted is never larger than the cluster.
#pragma once

#include <unseen/vdtree/mesh.h>

#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

// Where the numbers of one quadric lie: x'Mx + 2 h'x + k, and for each channel G'x + D - W s, the derivative by s.
namespace quadric {
enum : std::size_t { xx, xy, xz, yy, yz, zz, hx, hy, hz, k, weight, first_channel };
enum : std::size_t { gx, gy, gz, d, w, channel_size };
} // namespace quadric

inline constexpr std::size_t most_channels = 9; // luminance, normal, texture coordinates, colour
inline constexpr std::size_t most_quadric_floats =
    (quadric::first_channel + most_channels * quadric::channel_size + 3) / 4 * 4;

// Floats from one quadric to the next.
constexpr std::size_t quadric_stride(std::size_t channels) {
    return (quadric::first_channel + channels * quadric::channel_size + 3) / 4 * 4;
}

// sum = a + b, where b's place lies at (dx, dy, dz) from a's and b's references exceed a's by `difference`. F is float
// or one of the vectors.
template <class F>
UNSEEN_INLINE void add_from(const F* a, const F* b, F dx, F dy, F dz, const F* difference, std::size_t channels,
                            F* sum) {
    using namespace quadric;
    const F mdx = b[xx] * dx + b[xy] * dy + b[xz] * dz;
    const F mdy = b[xy] * dx + b[yy] * dy + b[yz] * dz;
    const F mdz = b[xz] * dx + b[yz] * dy + b[zz] * dz;
    F h_x = b[hx] - mdx, h_y = b[hy] - mdy, h_z = b[hz] - mdz;
    F rest = b[k] + mdx * dx + mdy * dy + mdz * dz - 2 * (b[hx] * dx + b[hy] * dy + b[hz] * dz);
    for (std::size_t i = xx; i <= zz; ++i) sum[i] = a[i] + b[i];
    sum[weight] = a[weight] + b[weight];
    for (std::size_t c = 0; c < channels; ++c) {
        const F *ca = a + first_channel + c * channel_size, *cb = b + first_channel + c * channel_size;
        F* cs = sum + first_channel + c * channel_size;
        const F moved = cb[d] - (cb[gx] * dx + cb[gy] * dy + cb[gz] * dz), raised = difference[c];
        h_x += raised * cb[gx], h_y += raised * cb[gy], h_z += raised * cb[gz];
        rest += raised * (2 * moved + raised * cb[w]);
        for (std::size_t i = gx; i <= gz; ++i) cs[i] = ca[i] + cb[i];
        cs[d] = ca[d] + moved + raised * cb[w];
        cs[w] = ca[w] + cb[w];
    }
    sum[hx] = a[hx] + h_x, sum[hy] = a[hy] + h_y, sum[hz] = a[hz] + h_z;
    sum[k] = a[k] + rest;
}

template <class F>
struct Minimum {
    F x, y, z, error;
};

// The least error of a sum whose parts lie at 0 and (dx, dy, dz), with the best channel values. Where the form is
// nearly flat its minimum may be far away; then the middle of the two is the better place.
template <class F>
UNSEEN_INLINE Minimum<F> minimise(const F* q, F dx, F dy, F dz, std::size_t channels) {
    using namespace quadric;
    F m00 = q[xx], m01 = q[xy], m02 = q[xz], m11 = q[yy], m12 = q[yz], m22 = q[zz];
    F r0 = q[hx], r1 = q[hy], r2 = q[hz], rest = q[k];
    for (std::size_t c = 0; c < channels; ++c) {
        const F* channel = q + first_channel + c * channel_size;
        const F inverse = 1 / channel[w];
        const F g0 = channel[gx] * inverse, g1 = channel[gy] * inverse, g2 = channel[gz] * inverse;
        m00 -= g0 * channel[gx], m01 -= g0 * channel[gy], m02 -= g0 * channel[gz];
        m11 -= g1 * channel[gy], m12 -= g1 * channel[gz], m22 -= g2 * channel[gz];
        r0 -= g0 * channel[d], r1 -= g1 * channel[d], r2 -= g2 * channel[d];
        rest -= channel[d] * channel[d] * inverse;
    }
    const F c00 = m11 * m22 - m12 * m12, c01 = m02 * m12 - m01 * m22, c02 = m01 * m12 - m02 * m11;
    const F c11 = m00 * m22 - m02 * m02, c12 = m01 * m02 - m00 * m12, c22 = m00 * m11 - m01 * m01;
    const F determinant = m00 * c00 + m01 * c01 + m02 * c02;
    const F scale = -1 / determinant;
    const F x = (c00 * r0 + c01 * r1 + c02 * r2) * scale;
    const F y = (c01 * r0 + c11 * r1 + c12 * r2) * scale;
    const F z = (c02 * r0 + c12 * r1 + c22 * r2) * scale;
    const F mx = dx * 0.5f, my = dy * 0.5f, mz = dz * 0.5f;
    const F from_middle = (x - mx) * (x - mx) + (y - my) * (y - my) + (z - mz) * (z - mz);
    const auto near = from_middle <= dx * dx + dy * dy + dz * dz; // false for NaN too
    Minimum<F> best{near ? x : mx, near ? y : my, near ? z : mz, F{}};
    const F ax = m00 * best.x + m01 * best.y + m02 * best.z + 2 * r0;
    const F ay = m01 * best.x + m11 * best.y + m12 * best.z + 2 * r1;
    const F az = m02 * best.x + m12 * best.y + m22 * best.z + 2 * r2;
    const F error = rest + ax * best.x + ay * best.y + az * best.z;
    best.error = error > 0 ? error : F{};
    return best;
}

// Moves the place by (x, y, z) and the references to the best channel values there.
inline void recentre(float* q, float x, float y, float z, float* references, std::size_t channels) {
    using namespace quadric;
    const float mx = q[xx] * x + q[xy] * y + q[xz] * z;
    const float my = q[xy] * x + q[yy] * y + q[yz] * z;
    const float mz = q[xz] * x + q[yz] * y + q[zz] * z;
    q[k] += mx * x + my * y + mz * z + 2 * (q[hx] * x + q[hy] * y + q[hz] * z);
    q[hx] += mx, q[hy] += my, q[hz] += mz;
    for (std::size_t c = 0; c < channels; ++c) {
        float* channel = q + first_channel + c * channel_size;
        const float there = channel[d] + channel[gx] * x + channel[gy] * y + channel[gz] * z;
        const float best = there / channel[w];
        q[hx] -= best * channel[gx], q[hy] -= best * channel[gy], q[hz] -= best * channel[gz];
        q[k] -= best * there;
        channel[d] = 0;
        references[c] += best;
    }
    q[k] = std::max(q[k], 0.0f);
}

} // namespace unseen::vdtree
