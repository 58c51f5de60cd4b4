#include "directions.h"

#include <bit>

namespace unseen::vdtree {

namespace {

constexpr float units = 127;    // of NormalSlabs in 1
constexpr float margin = 1e-4f; // units; covers the rounding of unit vectors in floats

// Four numbers at a time (an extension that GCC and Clang share).
using Floats = float __attribute__((vector_size(16)));
using Ints = int __attribute__((vector_size(16)));

// The slabs' axes, as NormalSlabs has them; the last one is none.
constexpr float s = 0.57735026918962576f;
constexpr Floats axis_x[2] = {{1, 0, 0, s}, {-s, s, s, 0}};
constexpr Floats axis_y[2] = {{0, 1, 0, s}, {s, -s, s, 0}};
constexpr Floats axis_z[2] = {{0, 0, 1, s}, {s, s, -s, 0}};

// 128 more than the least whole units not below `along`.
inline Ints reached(Floats along) { return 255 - __builtin_convertvector(units - margin - along, Ints); }

// Which of the eight rows, as in cell_of().
inline double row(double along, double b0, double b1, double b2) {
    const double a = std::abs(along);
    const double steps = (a >= b0 ? 1.0 : 0.0) + (a >= b1 ? 1.0 : 0.0) + (a >= b2 ? 1.0 : 0.0);
    return along < 0 ? 3 - steps : 4 + steps;
}

} // namespace

void NormalBatch::measure() noexcept {
    // In doubles: cross products of differences of floats neither overflow when squared nor lose what cells depend on.
    alignas(64) float x[capacity], y[capacity], z[capacity];
    for (std::size_t i = 0; i < capacity; ++i) {
        const auto at = [&](std::size_t k) { return static_cast<double>(corners_[k][i]); };
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
        cells_[i] = static_cast<int>(largest > 0 ? cell : -1.0);
        const double scale = units / std::sqrt(largest > 0 ? nx * nx + ny * ny + nz * nz : 1.0);
        x[i] = static_cast<float>(nx * scale);
        y[i] = static_cast<float>(ny * scale);
        z[i] = static_cast<float>(nz * scale);
    }
    // Whole units outward: what is cut off is below the ends of the scale.
    for (std::size_t i = 0; i < count_; ++i) {
        const Floats low = x[i] * axis_x[0] + y[i] * axis_y[0] + z[i] * axis_z[0],
                     high = x[i] * axis_x[1] + y[i] * axis_y[1] + z[i] * axis_z[1];
        const auto reach = std::bit_cast<std::array<int, 16>>(
            std::array<Ints, 4>{reached(low), reached(high), reached(-low), reached(-high)});
        for (std::size_t k = 0; k < 16; ++k) reach_[i][k] = static_cast<std::uint8_t>(reach[k]);
    }
    count_ = 0;
}

} // namespace unseen::vdtree
