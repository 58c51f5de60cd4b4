// Containment in (practically) exact arithmetic: with 113 bits of mantissa, differences, squares and sums of numbers
// that came as floats or doubles lose nothing that an outward rounding in float or double would not cover many times
// over.
#pragma once

#include <glm/vec3.hpp>

#include <unseen/vdtree/vertex_tree.h>

namespace unseen::support {

#ifdef __SIZEOF_FLOAT128__
__extension__ typedef __float128 Wide;
#else
using Wide = long double;
#endif

// The squared distance of two points of any precision.
template <class P, class Q>
Wide squared_distance(const P& p, const Q& q) {
    Wide sum = 0;
    for (int i = 0; i < 3; ++i) {
        const Wide d = static_cast<Wide>(p[i]) - static_cast<Wide>(q[i]);
        sum += d * d;
    }
    return sum;
}

// |p - centre| + radius <= outer radius, without a square root.
template <class P>
bool contains(const vdtree::Sphere& outer, const P& p, double radius = 0) {
    const Wide room = static_cast<Wide>(outer.radius) - static_cast<Wide>(radius);
    return room >= 0 && squared_distance(outer.centre, p) <= room * room;
}

} // namespace unseen::support
