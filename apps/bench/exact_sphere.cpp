#include "exact_sphere.h"

#ifdef UNSEEN_BENCH_WITH_CGAL
#include <cmath>

#include <CGAL/Cartesian.h>
#include <CGAL/Exact_rational.h>
#include <CGAL/Min_sphere_of_spheres_d.h>
#include <CGAL/Min_sphere_of_spheres_d_traits_3.h>
#endif

namespace unseen::app {

#ifdef UNSEEN_BENCH_WITH_CGAL
bool has_exact_spheres() { return true; }

vdtree::DSphere exact_sphere(std::span<const glm::dvec3> points) {
    using Number = CGAL::Exact_rational;
    using Traits = CGAL::Min_sphere_of_spheres_d_traits_3<CGAL::Cartesian<Number>, Number>;
    using Point = CGAL::Cartesian<Number>::Point_3;
    CGAL::Min_sphere_of_spheres_d<Traits> smallest;
    for (const glm::dvec3& p : points) smallest.insert(Traits::Sphere(Point(p.x, p.y, p.z), Number(0)));
    // Numbers of the form a + b sqrt(c).
    const double root = std::sqrt(CGAL::to_double(smallest.discriminant()));
    const auto value = [&](const auto& pair) {
        return CGAL::to_double(pair.first) + CGAL::to_double(pair.second) * root;
    };
    vdtree::DSphere sphere;
    sphere.radius = value(smallest.radius());
    auto coordinate = smallest.center_cartesian_begin();
    for (int k = 0; k < 3; ++k, ++coordinate) sphere.centre[k] = value(*coordinate);
    return sphere;
}
#else
bool has_exact_spheres() { return false; }
vdtree::DSphere exact_sphere(std::span<const glm::dvec3>) { return {}; }
#endif

} // namespace unseen::app
