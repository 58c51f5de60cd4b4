// Normal masks and slabs against brute force: every answer must hold for every normal, seen from every point.
#include <unseen/vdtree/internal/normal_mask.h>

#include <bit>

#include "shapes.h"
#include "testing.h"

namespace unseen::vdtree::normal_mask_test {

using shapes::random_between;
using shapes::random_direction;
using shapes::random_unit;

// A unit vector in floats, and the planes between two corners of a cell, are off by this much at most.
constexpr double unit_rounding = 1e-6;

glm::dvec3 corner(const NormalCell& cell, std::size_t k) { return {cell.x[k], cell.y[k], cell.z[k]}; }

// Whether a unit vector is on the inner side of the four great circles through a cell's corners.
bool lies_in_cell(glm::dvec3 n, const NormalCell& cell) {
    constexpr std::size_t around[5] = {0, 1, 3, 2, 0};
    glm::dvec3 middle(0);
    for (std::size_t k = 0; k < 4; ++k) middle += corner(cell, k);
    for (std::size_t k = 0; k < 4; ++k) {
        glm::dvec3 side = glm::normalize(glm::cross(corner(cell, around[k]), corner(cell, around[k + 1])));
        if (glm::dot(side, middle) < 0) side = -side;
        if (glm::dot(side, n) < -unit_rounding) return false;
    }
    return true;
}

TEST(NormalCell, ContainsTheDirectionsThatItIsChosenFor) {
    std::mt19937_64 random(1);
    for (int i = 0; i < 200'000; ++i) {
        const glm::dvec3 n = random_direction(random);
        const int cell = normal_cell(n * std::pow(10.0, random_between(random, -30, 30)));
        ASSERT_GE(cell, 0);
        ASSERT_LT(cell, normal_cell_count);
        ASSERT_TRUE(lies_in_cell(n, normal_cells()[static_cast<std::size_t>(cell)])) << n.x << ' ' << n.y << ' ' << n.z;
    }
}

TEST(NormalCell, EveryCellIsUsed) {
    std::mt19937_64 random(2);
    NormalMask mask;
    for (int i = 0; i < 100'000; ++i) mask.insert(normal_cell(random_direction(random)));
    for (const std::uint64_t face : mask.faces) EXPECT_EQ(face, ~std::uint64_t{0});
}

TEST(NormalMask, UnitesAndIncludes) {
    NormalMask a, b;
    EXPECT_TRUE(a.empty());
    EXPECT_TRUE(a.includes(b));
    a.insert(0), a.insert(200);
    b.insert(200), b.insert(383);
    EXPECT_TRUE(a.contains(0) && a.contains(200) && !a.contains(383) && !a.contains(1));
    EXPECT_FALSE(a.includes(b));
    NormalMask both = a;
    both |= b;
    EXPECT_TRUE(both.includes(a) && both.includes(b) && both.contains(383));
    EXPECT_FALSE(b.includes(both));
    int cells = 0;
    for (const std::uint64_t face : both.faces) cells += std::popcount(face);
    EXPECT_EQ(cells, 3);
}

// The coordinates that a slab bounds.
std::array<double, NormalSlabs::axis_count> along_axes(glm::dvec3 n) {
    const double s = 1 / std::sqrt(3.0);
    return {n.x, n.y, n.z, (n.x + n.y + n.z) * s, (-n.x + n.y + n.z) * s, (n.x - n.y + n.z) * s, (n.x + n.y - n.z) * s};
}

void expect_slabs_contain(const NormalSlabs& slabs, glm::dvec3 n) {
    const auto along = along_axes(n);
    for (std::size_t i = 0; i < NormalSlabs::axis_count; ++i) {
        ASSERT_LE(slabs.lo[i] / 127.0, along[i] + 1e-9) << "axis " << i << " of " << n.x << ' ' << n.y << ' ' << n.z;
        ASSERT_GE(slabs.hi[i] / 127.0, along[i] - 1e-9) << "axis " << i << " of " << n.x << ' ' << n.y << ' ' << n.z;
    }
}

TEST(NormalSlabs, ContainWhatIsInserted) {
    std::mt19937_64 random(3);
    for (int round = 0; round < 200; ++round) {
        NormalSlabs slabs;
        std::vector<glm::dvec3> normals;
        for (int i = 0; i < 5; ++i) slabs.insert(normals.emplace_back(random_direction(random)));
        for (const glm::dvec3& n : normals) expect_slabs_contain(slabs, n);
        EXPECT_TRUE(NormalSlabs::everything().includes(slabs));
    }
}

TEST(NormalSlabs, ContainTheEndsOfTheirAxes) {
    for (int x = -1; x <= 1; ++x) {
        for (int y = -1; y <= 1; ++y) {
            for (int z = -1; z <= 1; ++z) {
                if (x == 0 && y == 0 && z == 0) continue;
                const glm::dvec3 n = glm::normalize(glm::dvec3(x, y, z));
                NormalSlabs slabs;
                slabs.insert(n);
                EXPECT_FALSE(slabs.empty());
                expect_slabs_contain(slabs, n);
                EXPECT_TRUE(NormalSlabs::everything().includes(slabs));
            }
        }
    }
}

TEST(NormalSlabs, UniteAndInclude) {
    NormalSlabs a, b;
    EXPECT_TRUE(a.empty());
    a.insert({1, 0, 0});
    b.insert({0, 0.6, 0.8});
    EXPECT_FALSE(a.includes(b));
    NormalSlabs both = a;
    both |= b;
    EXPECT_TRUE(both.includes(a) && both.includes(b));
    EXPECT_TRUE(both.includes(NormalSlabs{}));
    EXPECT_FALSE(a.includes(both));
}

// How a triangle with the normal n at some point within `radius` of the centre can face the eye, exactly: n . (eye -
// p) over the sphere has the range distance n.to_eye -+ radius.
struct Facings {
    bool front = false, back = false;
    void add(glm::dvec3 n, glm::dvec3 to_eye, double distance, double radius) {
        const double middle = distance * glm::dot(n, to_eye);
        front |= middle + radius > 0;
        back |= middle - radius < 0;
    }
};

struct Situation {
    std::vector<glm::dvec3> normals;
    glm::vec3 to_eye;
    float distance, radius;
};

// Normals in a cap about a random middle, the sphere from far away up to the eye's own place. Every few rounds
// everything lies along axes, where comparisons with zero and signs of zero matter.
Situation random_situation(std::mt19937_64& random) {
    const auto axis = [&] {
        glm::dvec3 a(0);
        a[static_cast<int>(random() % 3)] = random() % 2 ? 1 : -1;
        return a;
    };
    const bool along_axes_only = random() % 5 == 0;
    Situation s;
    const glm::dvec3 middle = along_axes_only ? axis() : random_direction(random);
    const double cap = std::pow(10.0, random_between(random, -3, 0.3));
    const int count = 1 + static_cast<int>(random() % 8);
    for (int i = 0; i < count; ++i) {
        const glm::dvec3 n = middle + cap * random_unit(random) * random_direction(random);
        if (glm::length(n) > 1e-3) s.normals.push_back(glm::normalize(n));
    }
    if (s.normals.empty()) s.normals.push_back(middle);
    s.to_eye = glm::vec3(along_axes_only || random() % 5 == 0 ? axis() : random_direction(random));
    s.distance = static_cast<float>(std::pow(10.0, random_between(random, -3, 3)));
    s.radius = static_cast<float>(s.distance * std::pow(10.0, random_between(random, -4, 0.1)));
    return s;
}

TEST(Facing, NeverRulesOutWhatCanBeSeen) {
    std::mt19937_64 random(4);
    int front = 0, back = 0, mixed = 0;
    for (int round = 0; round < 300'000; ++round) {
        const Situation s = random_situation(random);
        NormalMask mask;
        NormalSlabs slabs;
        Facings truth;
        for (const glm::dvec3& n : s.normals) {
            mask.insert(normal_cell(n));
            slabs.insert(n);
            truth.add(n, glm::normalize(glm::dvec3(s.to_eye)), s.distance, s.radius);
        }
        for (const Facing answer :
             {facing(mask, s.to_eye, s.distance, s.radius), facing(slabs, s.to_eye, s.distance, s.radius),
              facing(slabs, mask, s.to_eye, s.distance, s.radius)}) {
            ASSERT_NE(answer, Facing::none);
            const glm::dvec3 n = s.normals[0];
            const bool wrong = (answer == Facing::front && truth.back) || (answer == Facing::back && truth.front);
            ASSERT_FALSE(wrong) << "round " << round << ": to the eye " << s.to_eye.x << ' ' << s.to_eye.y << ' '
                                << s.to_eye.z << ", first normal " << n.x << ' ' << n.y << ' ' << n.z;
            ++(answer == Facing::front ? front : answer == Facing::back ? back : mixed);
        }
    }
    EXPECT_GT(front, 50'000); // the test would be void if everything were mixed
    EXPECT_GT(back, 50'000);
    EXPECT_GT(mixed, 50'000);
}

TEST(Facing, HoldsForAnEyeOnAnAxis) {
    // To the eye at +z this normal turns its back; the negated direction has negative zeros.
    const glm::dvec3 n = glm::normalize(glm::dvec3(-1, -1, -1));
    NormalSlabs slabs;
    slabs.insert(n);
    EXPECT_EQ(facing(slabs, {0, 0, 1}, 100, 1), Facing::back);
    EXPECT_EQ(facing(slabs, {-0.0f, -0.0f, 1}, 100, 1), Facing::back);
    EXPECT_EQ(facing(slabs, {0, 0, -1}, 100, 1), Facing::front);
    EXPECT_EQ(facing(slabs, {-0.0f, -0.0f, -1}, 100, 1), Facing::front);
}

// A node's masks, slabs and sphere contain its children's. What the node rules out must be ruled out for them, or
// criteria would fall up the tree.
TEST(Facing, IsNoLessCertainForAPart) {
    std::mt19937_64 random(6);
    int decided = 0;
    for (int round = 0; round < 300'000; ++round) {
        const Situation s = random_situation(random);
        NormalMask mask, part_mask;
        NormalSlabs slabs, part_slabs;
        const std::size_t part = 1 + random() % s.normals.size();
        for (std::size_t i = 0; i < s.normals.size(); ++i) {
            mask.insert(normal_cell(s.normals[i]));
            slabs.insert(s.normals[i]);
            if (i >= part) continue;
            part_mask.insert(normal_cell(s.normals[i]));
            part_slabs.insert(s.normals[i]);
        }
        // A sphere within the sphere, often touching it from within.
        const double shift = s.radius * random_unit(random);
        const double room = s.radius - shift;
        const double part_radius = room * (random() % 2 ? 1 - 1e-6 : random_unit(random));
        const glm::dvec3 eye = static_cast<double>(s.distance) * glm::normalize(glm::dvec3(s.to_eye));
        const glm::dvec3 to_eye = eye - shift * random_direction(random);
        const auto distance = static_cast<float>(glm::length(to_eye));
        const auto direction = glm::vec3(glm::normalize(to_eye));
        const auto compare = [&](Facing whole, Facing of_part) {
            decided += whole != Facing::mixed;
            return whole == Facing::mixed || of_part == whole;
        };
        ASSERT_TRUE(compare(facing(mask, s.to_eye, s.distance, s.radius),
                            facing(part_mask, direction, distance, static_cast<float>(part_radius))))
            << "mask, round " << round;
        ASSERT_TRUE(compare(facing(slabs, s.to_eye, s.distance, s.radius),
                            facing(part_slabs, direction, distance, static_cast<float>(part_radius))))
            << "slabs, round " << round;
    }
    EXPECT_GT(decided, 100'000);
}

TEST(Facing, DecidesForSmallCapsAwayFromTheContour) {
    // A cell spans at most 1.41 * 90/8 degrees = 16 degrees; with 2 degrees of cap and 1 degree of sphere, a normal
    // at more than 25 degrees from the contour must be decided. Slabs lose up to 1/127 an axis: the same margin
    // holds.
    std::mt19937_64 random(5);
    const double margin = std::sin(25 * std::numbers::pi / 180);
    int decided = 0;
    for (int round = 0; round < 50'000; ++round) {
        const glm::dvec3 middle = random_direction(random), to_eye = random_direction(random);
        const double towards = glm::dot(middle, to_eye);
        if (std::abs(towards) < margin) continue;
        NormalMask mask;
        NormalSlabs slabs;
        for (int i = 0; i < 6; ++i) {
            const glm::dvec3 n = glm::normalize(middle + 0.035 * random_unit(random) * random_direction(random));
            mask.insert(normal_cell(n));
            slabs.insert(n);
        }
        const Facing truth = towards > 0 ? Facing::front : Facing::back;
        ASSERT_EQ(facing(mask, glm::vec3(to_eye), 100, 1.745f), truth);
        ASSERT_EQ(facing(slabs, glm::vec3(to_eye), 100, 1.745f), truth);
        ++decided;
    }
    EXPECT_GT(decided, 20'000);
}

TEST(Facing, DecidesForFlatSurfacesAlongTheAxes) {
    for (int axis = 0; axis < 3; ++axis) {
        for (const double sign : {-1.0, 1.0}) {
            glm::dvec3 n(0);
            n[axis] = sign;
            NormalSlabs slabs;
            slabs.insert(n);
            EXPECT_EQ(facing(slabs, glm::vec3(n), 10, 1), Facing::front);
            EXPECT_EQ(facing(slabs, -glm::vec3(n), 10, 1), Facing::back);
        }
    }
}

TEST(Facing, IsMixedInsideAndNoneForNothing) {
    NormalMask mask;
    NormalSlabs slabs;
    EXPECT_EQ(facing(mask, {0, 0, 1}, 10, 1), Facing::none);
    EXPECT_EQ(facing(slabs, {0, 0, 1}, 10, 1), Facing::none);
    mask.insert(normal_cell({0, 0, 1}));
    slabs.insert({0, 0, 1});
    const float nan = std::numeric_limits<float>::quiet_NaN();
    for (const auto& [distance, radius] :
         {std::pair{1.0f, 1.0f}, {0.5f, 1.0f}, {0.0f, 0.0f}, {nan, 1.0f}, {1.0f, nan}}) {
        EXPECT_EQ(facing(mask, {0, 0, 1}, distance, radius), Facing::mixed);
        EXPECT_EQ(facing(slabs, {0, 0, 1}, distance, radius), Facing::mixed);
    }
}

} // namespace unseen::vdtree::normal_mask_test
