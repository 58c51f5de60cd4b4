// Smallest spheres by CGAL's exact numbers, where there is CGAL. For tests that see vdtree's private headers.
#pragma once

#ifdef UNSEEN_TEST_WITH_CGAL
#include <cmath>
#include <vector>

#include <CGAL/Cartesian.h>
#include <CGAL/Exact_rational.h>
#include <CGAL/Min_sphere_of_spheres_d.h>
#include <CGAL/Min_sphere_of_spheres_d_traits_3.h>
#include <glm/vec3.hpp>

#include "build/bounding_sphere.h"

namespace unseen::support {

// The radius of the smallest sphere around points and spheres, by rational arithmetic.
inline double exact_radius(const std::vector<glm::dvec3>& points, const std::vector<vdtree::DSphere>& spheres = {}) {
    using Number = CGAL::Exact_rational;
    using Traits = CGAL::Min_sphere_of_spheres_d_traits_3<CGAL::Cartesian<Number>, Number>;
    using Point = CGAL::Cartesian<Number>::Point_3;
    CGAL::Min_sphere_of_spheres_d<Traits> smallest;
    for (const glm::dvec3& p : points) smallest.insert(Traits::Sphere(Point(p.x, p.y, p.z), Number(0)));
    for (const vdtree::DSphere& s : spheres)
        smallest.insert(Traits::Sphere(Point(s.centre.x, s.centre.y, s.centre.z), Number(s.radius)));
    const auto radius = smallest.radius(); // a + b sqrt(c)
    return CGAL::to_double(radius.first) +
           CGAL::to_double(radius.second) * std::sqrt(CGAL::to_double(smallest.discriminant()));
}

} // namespace unseen::support
#endif
