// Normals by corner: which corners share one, what it is, and that it takes no longer where very many faces meet.
#include "build/creases.h"

#include <set>

#include <unseen/vdtree/builder.h>

#include "build/surface.h"
#include "shapes.h"
#include "testing.h"

namespace unseen::vdtree::creases_test {

constexpr float hard = 0, smooth = 180; // degrees

struct Options {
    std::optional<float> crease = {};
    std::vector<glm::vec3> own = {}; // by corner
    float own_sign = 1;
};

// Of a mesh whose vertices are places.
CornerNormals find(const Mesh& mesh, const Options& options = {}) {
    const Surface surface = analyse_surface(mesh.view());
    return find_corner_normals(
        {mesh.positions, mesh.triangles, surface, options.own, mesh.smoothing, options.crease, options.own_sign});
}

// Normals at each place, in the order of the places.
std::vector<std::size_t> counts(const Mesh& mesh, const CornerNormals& found) {
    std::vector<std::set<Index>> numbers(mesh.positions.size());
    for (std::size_t corner = 0; corner < found.number.size(); ++corner)
        numbers[mesh.triangles[corner / 3][corner % 3]].insert(found.number[corner]);
    std::vector<std::size_t> counts;
    for (const auto& at : numbers) counts.push_back(at.size());
    return counts;
}

glm::dvec3 face_normal(const Mesh& mesh, std::size_t triangle) {
    const Triangle& t = mesh.triangles[triangle];
    return glm::normalize(
        glm::cross(mesh.positions[t[1]] - mesh.positions[t[0]], mesh.positions[t[2]] - mesh.positions[t[0]]));
}

glm::vec3 normal_of(const CornerNormals& found, std::size_t triangle, std::size_t k) {
    return found.normals[found.number[3 * triangle + k]];
}

// What every result must be: numbers in the order of places, one place each, unit normals.
std::string fault(const Mesh& mesh, const CornerNormals& found) {
    if (found.number.size() != 3 * mesh.triangles.size()) return "not every corner has a number";
    std::vector<Index> place(found.normals.size(), ~Index{0});
    for (std::size_t corner = 0; corner < found.number.size(); ++corner) {
        const Index number = found.number[corner], at = mesh.triangles[corner / 3][corner % 3];
        if (number >= place.size()) return "a number that no normal has";
        if (place[number] != ~Index{0} && place[number] != at) return "a number of two places";
        place[number] = at;
    }
    bool splits = false;
    for (std::size_t i = 0; i < place.size(); ++i) {
        if (place[i] == ~Index{0}) return "a normal that no corner has";
        if (i > 0 && place[i] < place[i - 1]) return "numbers in another order than places";
        splits = splits || (i > 0 && place[i] == place[i - 1]);
        const float length = glm::length(found.normals[i]);
        if (!(length == 0 || std::abs(length - 1) < 1e-6f)) return "a normal of another length";
    }
    return splits == found.has_creases ? "" : "has_creases is wrong";
}

// A disc of `sides` triangles around its centre, vertex 0, which lies `height` above the rim.
Mesh cone(int sides, double height) {
    Mesh m;
    m.positions = {{0, 0, height}};
    for (int i = 0; i < sides; ++i) {
        const double u = 2 * std::numbers::pi * i / sides;
        m.positions.emplace_back(std::cos(u), std::sin(u), 0);
        m.triangles.push_back({0, static_cast<Index>(1 + i), static_cast<Index>(1 + (i + 1) % sides)});
    }
    return m;
}

// With caps. Vertices: two at each side, the lower one first; then the centres of the lower and of the upper cap.
Mesh cylinder(int sides) {
    Mesh m;
    for (int i = 0; i < sides; ++i)
        for (const double z : {-1.0, 1.0})
            m.positions.emplace_back(std::cos(2 * std::numbers::pi * i / sides),
                                     std::sin(2 * std::numbers::pi * i / sides), z);
    const auto lower_centre = static_cast<Index>(2 * sides);
    m.positions.insert(m.positions.end(), {{0, 0, -1}, {0, 0, 1}});
    for (Index i = 0; i < lower_centre; i += 2) {
        const Index next = (i + 2) % lower_centre;
        m.triangles.insert(
            m.triangles.end(),
            {{i, next, next + 1}, {i, next + 1, i + 1}, {lower_centre, next, i}, {lower_centre + 1, i + 1, next + 1}});
    }
    return m;
}

// Two triangles on the edge from vertex 0 to 1, with this angle between their normals.
Mesh hinge(double degrees) {
    const double u = degrees * std::numbers::pi / 180;
    Mesh m;
    m.positions = {{0, 0, 0}, {1, 0, 0}, {0, -1, 0}, {0, std::cos(u), std::sin(u)}};
    m.triangles = {{1, 0, 2}, {0, 1, 3}};
    return m;
}

// ---- hard and smooth edges

TEST(Creases, CubeHasThreeExactNormalsAtEachCorner) {
    for (const int n : {1, 8}) {
        const Mesh cube = shapes::cube(n);
        const CornerNormals found = find(cube);
        EXPECT_EQ(fault(cube, found), "");
        EXPECT_EQ(found.creases, (Creases{Creases::Source::rule, 30}));
        for (std::size_t t = 0; t < cube.triangles.size(); ++t)
            for (std::size_t k = 0; k < 3; ++k)
                ASSERT_EQ(normal_of(found, t, k), glm::vec3(face_normal(cube, t))) << "of triangle " << t;
        const std::vector<std::size_t> at = counts(cube, found);
        for (std::size_t v = 0; v < at.size(); ++v) {
            const glm::dvec3& p = cube.positions[v];
            EXPECT_EQ(at[v],
                      static_cast<std::size_t>((std::abs(p.x) == 1) + (std::abs(p.y) == 1) + (std::abs(p.z) == 1)));
        }
        if (n == 1) EXPECT_EQ(found.normals.size(), 24u);
    }
}

TEST(Creases, CylindersAreRoundWithHardRims) {
    // The normals of 12 sides are 30 degrees apart, and more or less than that in floats.
    for (const int sides : {12, 32}) {
        const Mesh mesh = shapes::in_floats(cylinder(sides));
        const CornerNormals found = find(mesh);
        EXPECT_EQ(fault(mesh, found), "");
        const std::vector<std::size_t> at = counts(mesh, found);
        for (std::size_t v = 0; v < at.size(); ++v) EXPECT_EQ(at[v], v < static_cast<std::size_t>(2 * sides) ? 2u : 1u);
        for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
            for (std::size_t k = 0; k < 3; ++k) {
                const glm::vec3 normal = normal_of(found, t, k);
                if (t % 4 >= 2) { // a cap's
                    EXPECT_EQ(normal, glm::vec3(0, 0, t % 4 == 2 ? -1 : 1));
                } else { // nearer to the side with two triangles there
                    const glm::dvec3 p = mesh.positions[mesh.triangles[t][k]];
                    EXPECT_EQ(normal.z, 0);
                    EXPECT_GT(glm::dot(glm::dvec3(normal), glm::dvec3(p.x, p.y, 0)),
                              std::cos(std::numbers::pi / sides / 2.5));
                }
            }
        }
    }
}

TEST(Creases, AnEdgeIsHardAboveTheAngleAskedFor) {
    for (const double degrees : {0.0, 1.0, 29.9, 30.0, 30.2, 60.0, 90.0, 179.0, 180.0}) {
        const Mesh mesh = hinge(degrees);
        for (const float crease : {0.0f, 1.0f, 30.0f, 45.0f, 90.0f, 179.0f, 180.0f}) {
            const CornerNormals found = find(mesh, {crease});
            const std::size_t expected = degrees <= static_cast<double>(crease) ? 1 : 2;
            EXPECT_EQ(fault(mesh, found), "");
            EXPECT_EQ(found.creases, (Creases{Creases::Source::asked, crease}));
            EXPECT_EQ(counts(mesh, found), (std::vector<std::size_t>{expected, expected, 1, 1}))
                << degrees << " degrees, creases above " << crease;
        }
    }
}

// Bit for bit the normals by place that the builder has made of them.
TEST(Creases, SmoothSurfacesHaveTheNormalsOfTheirPlaces) {
    for (const Mesh& outward :
         {shapes::icosphere(3), shapes::torus(40, 20), shapes::bumpy_sphere(4, 0.002), shapes::grid(9)}) {
        for (const bool turned : {false, true}) {
            const Mesh mesh = turned ? shapes::inside_out(outward) : outward;
            const Surface surface = analyse_surface(mesh.view());
            for (const std::optional<float> crease : {std::optional<float>(), std::optional(smooth)}) {
                const CornerNormals found = find(mesh, {crease});
                EXPECT_EQ(fault(mesh, found), "");
                EXPECT_FALSE(found.has_creases);
                EXPECT_EQ(found.normals, surface.normals);
            }
        }
    }
}

TEST(Creases, SmoothMeansEverywhere) {
    const Mesh mesh = shapes::together(shapes::cube(3), shapes::spiky_star(3));
    const CornerNormals found = find(mesh, {smooth});
    EXPECT_EQ(found.normals, analyse_surface(mesh.view()).normals);
    EXPECT_FALSE(found.has_creases);
}

TEST(Creases, ACreaseThatEndsPartsNothingAtItsEnd) {
    // A flat grid, but for one vertex of the border that is lifted.
    Mesh mesh = shapes::grid(4);
    mesh.positions[2].z = 2;
    const CornerNormals found = find(mesh, {30.0f});
    EXPECT_EQ(fault(mesh, found), "");
    const std::vector<std::size_t> at = counts(mesh, found);
    EXPECT_GT(at[1], 1u);  // beside it
    EXPECT_EQ(at[12], 1u); // in the middle of the flat part
}

// ---- the rule

TEST(Creases, MadeThingsHaveHardEdgesAt30DegreesAndOrganicFormsAt60) {
    // A casting: a plate with a boss, both with right angles, and some chamfers of 45 degrees.
    Mesh casting = shapes::together(shapes::cube(6), cylinder(48));
    for (int i = 0; i < 20; ++i) casting = shapes::together(casting, shapes::placed(hinge(45), 0.3, {3, i, 0}));
    EXPECT_EQ(find(casting).creases, (Creases{Creases::Source::rule, 30}));
    // An organic form: curved as strongly as its triangles are large, so that few edges are above 60 degrees.
    const Mesh organic = shapes::bumpy_sphere(4, 0.03);
    EXPECT_EQ(find(organic).creases, (Creases{Creases::Source::rule, 60}));
    // The ratio decides: 5 edges above 30 for 2 above 60 are made, 6 are not.
    for (const auto& [above_30, expected] : {std::pair(3, 30.0f), {4, 60.0f}}) {
        Mesh hinges = shapes::together(hinge(61), hinge(120));
        for (int i = 0; i < above_30; ++i) hinges = shapes::together(hinges, hinge(59));
        for (int i = 0; i < 10; ++i) hinges = shapes::together(hinges, hinge(29));
        EXPECT_EQ(find(hinges).creases.degrees, expected);
        EXPECT_EQ(find(hinges, {45.0f}).creases, (Creases{Creases::Source::asked, 45}));
    }
}

TEST(Creases, NoiseOfAScanIsNoCrease) {
    Mesh scan = shapes::icosphere(5);
    for (std::size_t v = 100; v < 10000; v += 250) scan.positions[v] *= v < 700 ? 1.08 : 1.02; // few high ones
    ASSERT_TRUE(find(scan, {60.0f}).has_creases);
    const CornerNormals smoothed = find(scan);
    EXPECT_EQ(smoothed.creases, (Creases{Creases::Source::rule, 180}));
    EXPECT_FALSE(smoothed.has_creases);
    EXPECT_EQ(smoothed.normals, find(scan, {smooth}).normals);
    EXPECT_EQ(fault(scan, smoothed), "");
    // Edges of large faces are none, however few they are: a statue on a pedestal.
    Mesh statue = shapes::together(shapes::placed(scan, 0.5), shapes::cube(1));
    for (int i = 0; i < 60; ++i) statue = shapes::together(statue, shapes::placed(hinge(40), 0.01, {0, i, 3}));
    const CornerNormals found = find(statue);
    EXPECT_EQ(found.creases, (Creases{Creases::Source::rule, 60}));
    EXPECT_EQ(counts(statue, found)[scan.positions.size()], 3u);
}

// ---- smoothing groups

TEST(Creases, SmoothingGroupsDecideWhereTheyAreStated) {
    Mesh mesh = hinge(90);
    mesh.smoothing = {7, 7}; // one at any angle
    EXPECT_EQ(counts(mesh, find(mesh)), (std::vector<std::size_t>{1, 1, 1, 1}));
    EXPECT_EQ(find(mesh).creases.source, Creases::Source::file);
    EXPECT_EQ(counts(mesh, find(mesh, {hard})), (std::vector<std::size_t>{1, 1, 1, 1}));
    mesh = hinge(3);
    mesh.smoothing = {1, 2}; // never shared
    EXPECT_EQ(counts(mesh, find(mesh)), (std::vector<std::size_t>{2, 2, 1, 1}));
    EXPECT_EQ(counts(mesh, find(mesh, {smooth})), (std::vector<std::size_t>{2, 2, 1, 1}));
    mesh.smoothing = {0, 0}; // flat
    EXPECT_EQ(counts(mesh, find(mesh)), (std::vector<std::size_t>{2, 2, 1, 1}));
    mesh.smoothing = {0, 2};
    EXPECT_EQ(counts(mesh, find(mesh)), (std::vector<std::size_t>{2, 2, 1, 1}));
}

TEST(Creases, FlatFacesHaveTheNormalsOfTheirPlanes) {
    Mesh mesh = shapes::icosphere(2);
    mesh.smoothing.assign(mesh.triangles.size(), 0);
    const CornerNormals found = find(mesh);
    EXPECT_EQ(fault(mesh, found), "");
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
        for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(normal_of(found, t, k), glm::vec3(face_normal(mesh, t)));
    mesh = shapes::cube(4); // the two triangles of a square share theirs
    mesh.smoothing.assign(mesh.triangles.size(), 0);
    EXPECT_EQ(find(mesh).normals.size(), find(shapes::cube(4)).normals.size());
}

TEST(Creases, FacesOfOneSmoothingGroupShareWithoutACommonEdge) {
    Mesh mesh = shapes::together(shapes::single_triangle(), shapes::placed(shapes::single_triangle(), -1));
    mesh.triangles[1][0] = 0; // vertex 3 is where vertex 0 is
    mesh.smoothing = {4, 4};
    EXPECT_EQ(counts(mesh, find(mesh))[0], 1u);
}

// ---- the mesh's own normals

TEST(Creases, OwnNormalsAreKept) {
    const Mesh mesh = shapes::cube(2);
    std::mt19937_64 random(1);
    std::vector<glm::vec3> own;
    for (std::size_t i = 0; i < 3 * mesh.triangles.size(); ++i)
        own.push_back(glm::vec3(shapes::random_direction(random)) * 3.0f);
    const CornerNormals found = find(mesh, {{}, own});
    EXPECT_EQ(fault(mesh, found), "");
    EXPECT_EQ(found.creases, Creases());
    for (std::size_t i = 0; i < own.size(); ++i)
        EXPECT_LT(glm::distance(found.normals[found.number[i]], glm::normalize(own[i])), 0.005f);
}

TEST(Creases, NormalsThatAreMissingAreComputed) {
    const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
    const Mesh mesh = shapes::cube(1);
    const glm::vec3 up(0, 0, 1);
    for (const glm::vec3 missing : {glm::vec3(0), glm::vec3(nan, 0, 1), glm::vec3(infinity, 0, 0)}) {
        std::vector<glm::vec3> own(3 * mesh.triangles.size(), up);
        own[0] = missing;
        const CornerNormals found = find(mesh, {{}, own});
        EXPECT_EQ(fault(mesh, found), "");
        EXPECT_EQ(found.creases.source, Creases::Source::rule);
        EXPECT_EQ(normal_of(found, 0, 0), glm::vec3(face_normal(mesh, 0)));
        for (std::size_t i = 1; i < own.size(); ++i) EXPECT_EQ(found.normals[found.number[i]], up);
    }
}

TEST(Creases, NormalsThatAreNearlyEqualAreOne) {
    const Mesh mesh = hinge(0);
    for (const auto& [degrees, expected] : {std::pair(0.2f, 1u), {0.3f, 2u}}) {
        std::vector<glm::vec3> own(6, glm::vec3(0, 0, 1));
        const float u = degrees * std::numbers::pi_v<float> / 180;
        for (std::size_t i = 3; i < 6; ++i) own[i] = {std::sin(u), 0, std::cos(u)};
        const CornerNormals found = find(mesh, {{}, own});
        EXPECT_EQ(counts(mesh, found)[0], expected) << degrees;
        EXPECT_EQ(normal_of(found, 0, 0), own[0]); // the first one stands for both
        EXPECT_EQ(fault(mesh, found), "");
    }
}

TEST(Creases, NormalsOfAnInwardSurfaceAreTurned) {
    const Mesh mesh = shapes::icosphere(2), inward = shapes::inside_out(mesh);
    std::vector<glm::vec3> own(3 * mesh.triangles.size(), glm::vec3(0, 0, 1));
    for (std::size_t i = 0; i < own.size(); i += 3) own[i] = glm::vec3(0); // computed
    const CornerNormals found = find(mesh, {{}, own});
    for (const float own_sign : {1.0f, -1.0f}) {
        const CornerNormals turned = find(inward, {{}, own, own_sign});
        for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
            for (std::size_t k = 0; k < 3; ++k) {
                if (k == 0) ASSERT_EQ(inward.triangles[t][k], mesh.triangles[t][k]);
                EXPECT_EQ(normal_of(turned, t, k), k == 0 ? normal_of(found, t, 0) : own_sign * glm::vec3(0, 0, 1));
            }
    }
}

// ---- awkward surfaces

TEST(Creases, AnyTwoFacesOfANonManifoldEdgeMayShare) {
    // Pages 10 degrees apart all share, one after the other; a last one stands alone.
    Mesh book;
    book.positions = {{0, 0, 0}, {0, 0, 1}};
    for (const double degrees : {0.0, 20.0, 10.0, 30.0, 130.0}) {
        const double u = degrees * std::numbers::pi / 180;
        book.positions.emplace_back(std::cos(u), std::sin(u), 0);
        book.triangles.push_back({0, 1, static_cast<Index>(book.positions.size() - 1)});
    }
    const CornerNormals found = find(book, {12.0f});
    EXPECT_EQ(fault(book, found), "");
    EXPECT_EQ(counts(book, found), (std::vector<std::size_t>{2, 2, 1, 1, 1, 1, 1}));
    for (const std::size_t page : {1u, 2u, 3u}) EXPECT_EQ(found.number[3 * page], found.number[0]);
    EXPECT_NE(found.number[3 * 4], found.number[0]);
    EXPECT_EQ(counts(book, find(book, {8.0f}))[0], 5u);
    EXPECT_EQ(counts(book, find(book, {smooth}))[0], 1u);
    // Across the cut where angles start again.
    const Mesh ring = shapes::non_manifold_fan(36);
    EXPECT_EQ(counts(ring, find(ring, {12.0f}))[0], 1u);
}

TEST(Creases, FacesThatFaceOppositeWaysShareNothing) {
    Mesh mesh = hinge(0);
    std::swap(mesh.triangles[1][0], mesh.triangles[1][1]);
    EXPECT_EQ(counts(mesh, find(mesh)), (std::vector<std::size_t>{2, 2, 1, 1}));
    EXPECT_EQ(fault(mesh, find(mesh)), "");
    const Mesh strip = shapes::moebius_strip(30);
    EXPECT_EQ(fault(strip, find(strip)), "");
}

TEST(Creases, FacesWithoutAnAreaPartNothingAndJoinNothing) {
    // The edge from 0 to 1 has a vertex in its middle on one side, and a triangle of no area closes the gap.
    for (const double degrees : {0.0, 90.0}) {
        for (const double lift : {0.0, 1e-9}) {
            Mesh mesh = hinge(degrees);
            mesh.positions.emplace_back(0.5, lift, 0);
            mesh.triangles = {{1, 0, 2}, {0, 4, 3}, {4, 1, 3}, {0, 1, 4}};
            const CornerNormals found = find(mesh, {30.0f});
            EXPECT_EQ(fault(mesh, found), "");
            const std::size_t expected = degrees == 0 ? 1 : 2;
            EXPECT_EQ(counts(mesh, found), (std::vector<std::size_t>{expected, expected, 1, 1, 1}));
        }
    }
    // No area at all.
    Mesh line;
    line.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
    line.triangles = {{0, 1, 2}, {2, 1, 0}};
    for (const std::optional<float> crease : {std::optional<float>(), std::optional(hard), std::optional(smooth)}) {
        const CornerNormals found = find(line, {crease});
        EXPECT_EQ(fault(line, found), "");
        EXPECT_THAT(found.normals, Each(glm::vec3(0)));
        EXPECT_EQ(found.normals.size(), 3u);
    }
}

TEST(Creases, HugeAndTinyMeshesAreLikeOthers) {
    for (const double scale : {1e-36, 1e-9, 1e9, 1e36})
        EXPECT_EQ(find(shapes::placed(shapes::cube(3), scale)).normals, find(shapes::cube(3)).normals) << scale;
    const Mesh endless = shapes::placed(shapes::cube(1), 1e300); // areas overflow
    EXPECT_EQ(fault(endless, find(endless)), "");
    EXPECT_EQ(find({}).normals.size(), 0u);
}

TEST(Creases, SoupsAndUnusedPlacesDoNoHarm) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
        Mesh soup = shapes::random_soup(12, 60, seed);
        for (Index t = 0; t < 10; ++t) soup.triangles.push_back({t, t + 1, (t + 5) % 12}); // some twice
        soup.positions.emplace_back(0, 0, 0);                                              // in no triangle
        for (const bool stated : {false, true}) {
            if (stated)
                for (std::size_t t = 0; t < soup.triangles.size(); ++t)
                    soup.smoothing.push_back(static_cast<Index>(t % 4));
            for (const std::optional<float> crease :
                 {std::optional<float>(), std::optional(hard), std::optional(smooth)})
                EXPECT_EQ(fault(soup, find(soup, {crease})), "") << "seed " << seed;
        }
    }
}

// ---- cost

TEST(Creases, WorkGrowsWithTheNumberOfFacesAtAPlace) {
    std::mt19937_64 random(5);
    const auto work = [&](int faces) {
        std::vector<std::uint64_t> compared;
        for (const Mesh& mesh : {cone(faces, 0), cone(faces, 1), shapes::non_manifold_fan(faces)})
            for (const float crease : {hard, 30.0f}) compared.push_back(find(mesh, {crease}).compared);
        const Mesh pole = cone(faces, 1);
        std::vector<glm::vec3> own(static_cast<std::size_t>(3 * faces));
        for (glm::vec3& n : own) n = glm::vec3(shapes::random_direction(random)); // all different
        const CornerNormals found = find(pole, {{}, own});
        EXPECT_GT(found.normals.size(), own.size() / 2);
        EXPECT_EQ(fault(pole, found), "");
        compared.push_back(found.compared);
        return compared;
    };
    const std::vector<std::uint64_t> some = work(6'000), many = work(60'000);
    for (std::size_t i = 0; i < some.size(); ++i) EXPECT_LE(many[i], 15 * some[i]) << i; // for ten times the faces
    EXPECT_THAT(many, Each(AllOf(Ge(60'000u), Le(60'000u * 20))));
}

TEST(Creases, AnglesAreChecked) {
    for (const float good : {0.0f, 30.0f, 180.0f}) EXPECT_TRUE(check_crease(good));
    EXPECT_TRUE(check_crease({}));
    for (const float bad :
         {-1.0f, 180.5f, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        const auto checked = check_crease(bad);
        ASSERT_FALSE(checked);
        EXPECT_EQ(checked.error().code, ErrorCode::invalid_argument);
        EXPECT_THAT(checked.error().message, HasSubstr("0 to 180"));
    }
}

// ---- trees

TEST(Creases, TreesHaveALeafForEachNormalAndSayHowItWasFound) {
    BuildOptions options;
    const auto tree = [&](const Mesh& mesh) { return require(build_tree(mesh.view(), options)); };
    EXPECT_EQ(tree(shapes::cube(1))->leaf_count(), 24u);
    EXPECT_EQ(tree(shapes::cube(1))->creases(), (Creases{Creases::Source::rule, 30}));
    const auto inward = tree(shapes::inside_out(shapes::cube(1)));
    for (Index leaf = 0; leaf < inward->leaf_count(); ++leaf) {
        const glm::vec3 normal = inward->normals()[inward->wedge_of_leaf(leaf)];
        EXPECT_GT(glm::dot(normal, inward->position(inward->place_of_leaf(leaf))), 0.9f);
    }
    options.crease = 90.0f;
    EXPECT_EQ(tree(shapes::cube(1))->leaf_count(), 8u);
    EXPECT_EQ(tree(shapes::cube(1))->creases(), (Creases{Creases::Source::asked, 90}));
    Mesh flat = shapes::with_degenerate_triangles(shapes::icosphere(1)); // whose groups go with the triangles
    for (std::size_t t = 0; t < flat.triangles.size(); ++t)
        flat.smoothing.push_back(uses_a_vertex_twice(flat.triangles[t]) ? 1 : 0);
    EXPECT_EQ(tree(flat)->leaf_count(), 3 * shapes::icosphere(1).triangles.size());
    EXPECT_EQ(tree(flat)->creases(), Creases());
    options.crease = -1.0f;
    EXPECT_THAT(build_tree(flat.view(), options).error().message, HasSubstr("0 to 180 degrees"));
}

} // namespace unseen::vdtree::creases_test
