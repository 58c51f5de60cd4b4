#include "tree/directions.h"

#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

namespace {

constexpr float units = 127;    // of NormalSlabs in 1
constexpr float margin = 2e-4f; // units; covers the rounding of unit vectors in floats, here and in what checks them

// The slabs' axes, in the order of NormalSlabs; the last one is unused.
constexpr float s = 0.57735026918962576f;
constexpr Float8 axis_x = {1, 0, 0, s, -s, s, s, 0};
constexpr Float8 axis_y = {0, 1, 0, s, s, -s, s, 0};
constexpr Float8 axis_z = {0, 0, 1, s, s, s, -s, 0};
constexpr Int4 is_axis = {-1, -1, -1, 0}; // of the second four

// 128 more than the least whole units not below `along`.
UNSEEN_INLINE Int8 reached(Float8 along) { return 255 - __builtin_convertvector(units - margin - along, Int8); }

// Which of the eight rows, as in cell_of().
inline double row(double along, double b0, double b1, double b2) {
    const double a = std::abs(along);
    const double steps = (a >= b0 ? 1.0 : 0.0) + (a >= b1 ? 1.0 : 0.0) + (a >= b2 ? 1.0 : 0.0);
    return along < 0 ? 3 - steps : 4 + steps;
}

template <std::size_t capacity>
struct Batch {
    std::size_t count;
    const Corner (&triangles)[capacity][3];
    int (&cells)[capacity];
    Directions::Reach (&reach)[capacity];
};

// Coordinate `axis` of corner `corner` of all triangles is number 3 * corner + axis.
template <std::size_t capacity>
UNSEEN_INLINE void transpose(const Corner (&triangles)[capacity][3], float (&coordinates)[9][capacity]) {
    for (std::size_t i = 0; i < capacity; i += 4) {
        for (std::size_t corner = 0; corner < 3; ++corner) {
            const Float4 rows[4] = {triangles[i][corner], triangles[i + 1][corner], triangles[i + 2][corner],
                                    triangles[i + 3][corner]};
            Float4 out[4]; // the last one does not matter
            vdtree::transpose(rows, out);
            for (std::size_t axis = 0; axis < 3; ++axis)
                std::memcpy(&coordinates[3 * corner + axis][i], &out[axis], sizeof(Float4));
        }
    }
}

template <std::size_t capacity>
UNSEEN_INLINE void measure_all(const Batch<capacity>& batch) {
    // In doubles: cross products of differences of floats neither overflow when squared nor lose what cells depend on.
    alignas(64) float corners[9][capacity], x[capacity], y[capacity], z[capacity];
    transpose(batch.triangles, corners);
    for (std::size_t i = 0; i < capacity; ++i) {
        const auto at = [&](std::size_t k) { return static_cast<double>(corners[k][i]); };
        const double ux = at(3) - at(0), uy = at(4) - at(1), uz = at(5) - at(2);
        const double vx = at(6) - at(0), vy = at(7) - at(1), vz = at(8) - at(2);
        const double nx = uy * vz - vy * uz, ny = uz * vx - vz * ux, nz = ux * vy - vx * uy;
        const double ax = std::abs(nx), ay = std::abs(ny), az = std::abs(nz);
        const double axy = ax >= ay ? ax : ay, largest = axy >= az ? axy : az;
        const double b0 = cell_borders[0] * largest, b1 = cell_borders[1] * largest, b2 = cell_borders[2] * largest;
        const double rx = row(nx, b0, b1, b2), ry = row(ny, b0, b1, b2), rz = row(nz, b0, b1, b2);
        // By the axis of the largest component: its face, and the rows of the two next axes.
        const double on_x = (nx < 0 ? 64.0 : 0.0) + ry + 8 * rz, on_y = (ny < 0 ? 192.0 : 128.0) + rz + 8 * rx,
                     on_z = (nz < 0 ? 320.0 : 256.0) + rx + 8 * ry;
        const double on_xz = ax >= az ? on_x : on_z, on_yz = ay >= az ? on_y : on_z;
        const double cell = ax >= ay ? on_xz : on_yz;
        batch.cells[i] = static_cast<int>(largest > 0 ? cell : -1.0);
        const double scale = 1 / (largest > 0 ? largest : 1.0);
        x[i] = static_cast<float>(nx * scale);
        y[i] = static_cast<float>(ny * scale);
        z[i] = static_cast<float>(nz * scale);
    }
    // Now that the largest component is 1, floats do.
    for (std::size_t i = 0; i < capacity; ++i) {
        const float squared = x[i] * x[i] + y[i] * y[i] + z[i] * z[i],
                    scale = units / std::sqrt(squared > 0 ? squared : 1);
        x[i] *= scale;
        y[i] *= scale;
        z[i] *= scale;
    }
    // Whole units outward: what is cut off is below the ends of the scale. Four numbers of eight bits are shifted into
    // each lane.
    for (std::size_t i = 0; i < batch.count; ++i) {
        const Float8 along = x[i] * axis_x + y[i] * axis_y + z[i] * axis_z;
        const Int8 reach = reached(along) | reached(-along) << 8;
        Int4 first, second;
        std::memcpy(&first, &reach, sizeof first);
        std::memcpy(&second, reinterpret_cast<const char*>(&reach) + sizeof first, sizeof second);
        batch.reach[i] = std::bit_cast<Directions::Reach>(first | (second & is_axis) << 16);
    }
}

using FullBatch = Batch<NormalBatch::capacity>;

UNSEEN_AVX2 void measure_avx2(const FullBatch& batch) { measure_all(batch); }

} // namespace

// Neither has fused operations, so both give the same bits.
void NormalBatch::measure() noexcept {
    const FullBatch batch{count_, triangles_, cells_, reach_};
    if (has_avx2()) measure_avx2(batch);
    else measure_all(batch);
    count_ = 0;
}

} // namespace unseen::vdtree
