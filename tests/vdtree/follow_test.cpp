// Cuts that follow a viewpoint: whatever the way, they are what the criterion asks for, and the index buffer is theirs. Calls
// in any order, copied criteria, bad input and what is left when time is up: see follow_property_test.cpp.
#include <unseen/vdtree/cut.h>

#include <unseen/vdtree/builder.h>

#include "cut/index_buffer.h"
#include "cut/kernel/fold_tester.h"
#include "follow_tools.h"
#include "shapes.h"
#include "sound.h"
#include "testing.h"
#include "tree_checks.h"

namespace unseen::vdtree::follow_test {

using shapes::random_unit;
using support::from_scratch;
using support::gathered;
using support::state_of;
using support::triangles_of;

// Frames a mesh class. A view of a few minutes has ten thousand, in which rare sequences of changes turn up, too: the
// environment variable UNSEEN_FRAMES asks for so many.
int frame_count() {
    const char* asked = std::getenv("UNSEEN_FRAMES");
    return asked ? std::atoi(asked) : 400;
}

VertexTree built(const Mesh& mesh, ClustererKind kind = ClustererKind::quadric) {
    return std::move(*require(build_tree(mesh.view(), {.clusterer = kind, .threads = 1})));
}

// Many quads, each on its own, turned anyhow.
Mesh leaves(int count) {
    std::mt19937_64 random(5);
    Mesh mesh;
    for (int i = 0; i < count; ++i) {
        const auto direction = [&] {
            return glm::normalize(glm::dvec3(random_unit(random), random_unit(random), random_unit(random)) - 0.5 +
                                  1e-3);
        };
        const glm::dvec3 centre(4 * random_unit(random), 4 * random_unit(random), 4 * random_unit(random));
        const glm::dvec3 a = 0.1 * direction(), b = 0.1 * glm::normalize(glm::cross(a, direction()));
        const Index first = static_cast<Index>(mesh.positions.size());
        for (const glm::dvec3 corner : {centre - a - b, centre + a - b, centre + a + b, centre - a + b})
            mesh.positions.push_back(corner);
        mesh.triangles.push_back({first, first + 1, first + 2});
        mesh.triangles.push_back({first, first + 2, first + 3});
    }
    return mesh;
}

struct MeshClass {
    const char* name;
    Mesh (*make)();
    bool has_small_rings = true; // much smaller than the mesh: some lie wholly behind others
};
const MeshClass mesh_classes[] = {
    {"organic", [] { return shapes::bumpy_sphere(4, 0.03); }},
    {"foliage", [] { return leaves(600); }},
    {"cad",
     [] {
         return shapes::together(shapes::cube(12), shapes::placed(shapes::torus(40, 16), 0.6, {1, 0.5, 0}));
     }},
    {"soup", [] { return shapes::random_soup(500, 1500, 7); }, false},
};

// A criterion of everything that there is: silhouettes, eccentricity, rows that differ from node to node, monotone.
DistanceCriterion rich_criterion(const VertexTree& tree, std::uint64_t seed, bool with_gaze) {
    std::mt19937_64 random(seed);
    constexpr std::size_t rows = 24;
    DistanceCriterion::Parts parts;
    parts.eccentricity_bins = with_gaze ? 40 : 1;
    parts.bin_degrees = 1.5;
    // Every other criterion has lengths of its own for outlines, some longer, some shorter than those of the interior.
    if (seed % 2 == 1) {
        parts.silhouette_lengths.resize(tree.interior_count());
        for (NodeId node = tree.interior_count(); node-- > 0;) {
            float& own = parts.silhouette_lengths[node];
            own = std::max(own, tree.bounds()[node].ring.radius * static_cast<float>(0.2 + random_unit(random)));
            if (node > 0)
                parts.silhouette_lengths[support::sound(tree).parents()[node]] =
                    std::max(parts.silhouette_lengths[support::sound(tree).parents()[node]], own);
        }
    }
    parts.classes.resize(tree.interior_count());
    for (NodeId node = tree.interior_count(); node-- > 0;) {
        FoldClass& own = parts.classes[node];
        own.interior = std::max(own.interior, static_cast<std::uint16_t>(random() % 8));
        own.silhouette =
            std::max<std::uint16_t>({own.silhouette, own.interior, static_cast<std::uint16_t>(8 + random() % 15)});
        if (node == 0) break;
        FoldClass& parent = parts.classes[support::sound(tree).parents()[node]];
        parent.interior = std::max(parent.interior, own.interior);
        parent.silhouette = std::max(parent.silhouette, own.silhouette);
    }
    for (std::size_t row = 0; row < rows; ++row)
        for (std::size_t bin = 0; bin < parts.eccentricity_bins; ++bin)
            parts.switch_distance.push_back(
                row == 0 ? DistanceCriterion::never_visible
                : row == rows - 1
                    ? DistanceCriterion::always_visible
                    : static_cast<float>(2.0 * static_cast<double>(row) * std::exp(-0.06 * static_cast<double>(bin))));
    return std::move(*require(DistanceCriterion::create(tree, std::move(parts))));
}

// Costs of a fold from the definition, in doubles: nothing for what is out of sight or faces away, else the distance
// within which its interior, or its silhouette, unfolds at the threshold 1, over its gap; least costs counted in for
// `seen_cost`. Without a gaze or away from the bins' edges.
void expect_cost_by_definition(const DistanceCriterion& criterion, const FoldCandidate& of, const Viewpoint& viewpoint,
                               float cost, float seen_cost) {
    const DistanceCriterion::Parts& parts = criterion.parts();
    const glm::dvec3 to_eye = viewpoint.eye - glm::dvec3(of.sphere.centre);
    const double distance = glm::length(to_eye), radius = of.sphere.radius, gap = distance - radius;
    if (std::abs(gap) < 1e-3 * distance) return; // too near to tell in floats
    double eccentricity = 0;
    if (viewpoint.gaze && radius < 0.95 * distance) { // see nearly_inside
        const double angle = std::acos(std::clamp(-glm::dot(to_eye, *viewpoint.gaze) / distance, -1.0, 1.0));
        eccentricity = std::max(angle - std::asin(radius / distance), 0.0);
    }
    const double bins = eccentricity * 180 / std::numbers::pi / parts.bin_degrees;
    if (std::abs(bins - std::round(bins)) < 0.02 && bins > 0.5) return;
    const auto bin = std::min(static_cast<std::size_t>(bins), parts.eccentricity_bins - 1);
    const auto costs = [&](std::size_t row, double length) -> std::array<double, 2> {
        const double switch_distance = parts.switch_distance[row * parts.eccentricity_bins + bin];
        if (switch_distance < 0 || (length * switch_distance <= 0 && gap > 0)) return {0, 0};
        const double infinite = std::numeric_limits<double>::infinity();
        const double own = switch_distance >= double{DistanceCriterion::always_visible} || gap <= 0
                               ? infinite
                               : length * switch_distance / gap;
        return {own, parts.least_cost.empty()
                         ? own
                         : std::max<double>(own, parts.least_cost[row * parts.eccentricity_bins + bin])};
    };
    const auto interior = costs(of.rows.interior, of.length),
               silhouette = costs(of.rows.silhouette, of.silhouette_length);
    const auto is_about = [](double expected, float found) {
        return expected == double{found} || std::abs(expected - double{found}) <= 1e-3 * expected;
    };
    const bool is_nothing = cost == 0 && seen_cost == 0;
    const bool as_interior = is_about(interior[0], cost) && is_about(interior[1], seen_cost);
    const bool as_silhouette = is_about(std::max(interior[0], silhouette[0]), cost) &&
                               is_about(std::max(interior[1], silhouette[1]), seen_cost);
    ASSERT_TRUE(is_nothing || as_interior || as_silhouette)
        << "node " << of.node << " costs " << cost << " and " << seen_cost;
}

glm::dvec3 random_direction(std::mt19937_64& random) {
    glm::dvec3 d;
    do d = 2.0 * glm::dvec3(random_unit(random), random_unit(random), random_unit(random)) - 1.0;
    while (!(glm::length(d) > 0.1 && glm::length(d) < 1));
    return glm::normalize(d);
}

// Spheres in the model, be it solid or not; near enough to the eye to be in its way, and others.
std::vector<Sphere> occluders_in(const VertexTree& tree) {
    const auto [centre, r] = tree.bounding_sphere();
    std::vector<Sphere> spheres;
    for (const auto& [offset, radius] : {std::pair(0.0f, 0.5f), std::pair(0.4f, 0.3f), std::pair(-0.6f, 0.1f)})
        spheres.push_back({glm::vec3(centre) + offset * r * glm::vec3(0.6f, 0.64f, 0.48f), radius * r});
    return spheres;
}

// Those that the eye is not in.
std::vector<Sphere> occluders_seen_from(glm::dvec3 eye, std::span<const Sphere> occluders) {
    std::vector<Sphere> seen;
    for (const Sphere& occluder : occluders)
        if (glm::length(glm::dvec3(occluder.centre) - eye) > static_cast<double>(occluder.radius))
            seen.push_back(occluder);
    return seen;
}

// A path of small steps, turns of the gaze, stops, cuts to elsewhere, the inside of the model and far away.
class Path {
public:
    Path(const VertexTree& tree, std::uint64_t seed, bool with_gaze, bool with_frustum)
        : tree_(tree), random_(seed), with_gaze_(with_gaze), with_frustum_(with_frustum) {
        const Sphere sphere = tree.bounding_sphere();
        centre_ = glm::dvec3(sphere.centre);
        radius_ = sphere.radius;
        jump();
    }

    Viewpoint next() {
        switch (random_() % 24) {
        case 0: jump(); break;
        case 1: gaze_ = random_direction(random_); break;
        case 2: break; // stands still
        case 3: velocity_ = random_direction(random_) * radius_ * std::pow(10.0, -1 - 3 * random_unit(random_)); break;
        default:
            eye_ += velocity_;
            turn_ = glm::normalize(turn_ + 0.01 * velocity_ / radius_);
            break;
        }
        Viewpoint viewpoint{.eye = eye_};
        if (with_gaze_) viewpoint.gaze = glm::normalize(gaze_ + 0.02 * turn_);
        if (with_frustum_) {
            View view;
            view.eye = tree_.origin() + eye_;
            view.target = tree_.origin() + centre_ + 0.3 * radius_ * turn_;
            view.up = {0.1, 1, 0.05};
            if (validate(view)) viewpoint.frusta.push_back(frustum_of(tree_, view));
            else viewpoint.frusta.push_back({Plane{{0, 0, 1}, 0}});
        }
        viewpoint.occluders = occluders_seen_from(eye_, occluders_);
        return viewpoint;
    }

    void put_occluders() { occluders_ = occluders_in(tree_); }

private:
    void jump() {
        eye_ = centre_ + random_direction(random_) * radius_ * std::pow(10.0, 2.5 * random_unit(random_) - 1);
        velocity_ = random_direction(random_) * radius_ * 0.02;
        gaze_ = glm::normalize(centre_ - eye_);
    }

    const VertexTree& tree_;
    std::mt19937_64 random_;
    bool with_gaze_, with_frustum_;
    glm::dvec3 centre_, eye_{0}, velocity_{0}, gaze_{0, 0, 1}, turn_{0, 1, 0};
    double radius_;
    std::vector<Sphere> occluders_;
};

class Follow : public testing::TestWithParam<MeshClass> {};
INSTANTIATE_TEST_SUITE_P(MeshClasses, Follow, testing::ValuesIn(mesh_classes),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(Follow, EqualsTheCutFromScratchOnRandomPaths) {
    const VertexTree tree = built(GetParam().make());
    std::uint64_t incremental_tests = 0, all_tests = 0;
    int hiding_frames = 0; // in which occluders make a difference
    for (unsigned variant = 0; variant < 8; ++variant) {
        const bool with_gaze = variant & 1, with_frustum = variant & 2, with_occluders = variant & 4;
        const DistanceCriterion criterion = rich_criterion(tree, 3, with_gaze);
        Path path(tree, 11 + variant, with_gaze, with_frustum);
        if (with_occluders) path.put_occluders();
        Cut cut(tree);
        FollowOptions options;
        options.cull_back_faces = with_gaze && with_frustum && tree.closedness() != Closedness::open;
        for (int frame = 0; frame < frame_count() / 8; ++frame) {
            const Viewpoint viewpoint = path.next();
            const auto stats = require(cut.follow(criterion, viewpoint, options));
            const std::vector<bool> expected = from_scratch(tree, criterion, viewpoint, options);
            ASSERT_EQ(state_of(cut), expected) << "frame " << frame << ", variant " << variant;
            ASSERT_EQ(support::fault_in_cut(cut), "") << "frame " << frame << ", variant " << variant;
            ASSERT_EQ(triangles_of(cut.indices()), gathered(cut)) << "frame " << frame << ", variant " << variant;
            incremental_tests += stats->node_tests;
            all_tests += static_cast<std::uint64_t>(std::count(expected.begin(), expected.end(), true));
            if (!with_occluders) continue;
            Viewpoint unhidden = viewpoint;
            unhidden.occluders.clear();
            hiding_frames += expected != from_scratch(tree, criterion, unhidden, options);
        }
    }
    EXPECT_LT(incremental_tests, 4 * all_tests);
    if (GetParam().has_small_rings) EXPECT_GT(hiding_frames, frame_count() / 20);
}

// Views of parts of the model, some two at a time, that turn, go on and zoom by steps of all sizes, with the eye or
// apart from it: nodes are due by planes that cut the model, and blocks of them go in and out.
TEST_P(Follow, EqualsTheCutFromScratchInFrustaThatCutTheModel) {
    const VertexTree tree = built(GetParam().make());
    const Sphere sphere = tree.bounding_sphere();
    const glm::dvec3 centre = tree.origin() + glm::dvec3(sphere.centre);
    const DistanceCriterion criterion = rich_criterion(tree, 5, false);
    std::mt19937_64 random(31);
    int cut_frames = 0, all_frames = 0; // in which a frustum makes a difference
    for (int way = 0; way < frame_count() / 13; ++way) {
        const std::size_t count = 1 + way % 2;
        const double pace = std::pow(10.0, -1 - 2 * random_unit(random));
        glm::dvec3 eye = (1.1 + 4 * random_unit(random)) * sphere.radius * random_direction(random);
        const glm::dvec3 step = way % 3 == 0 ? glm::dvec3(0) : pace * sphere.radius * random_direction(random);
        std::vector<glm::dvec3> targets(count), turns(count);
        std::vector<double> fields(count), zooms(count);
        for (std::size_t i = 0; i < count; ++i) {
            targets[i] = 0.8 * sphere.radius * random_unit(random) * random_direction(random);
            turns[i] = way % 5 == 0 ? glm::dvec3(0) : pace * sphere.radius * random_direction(random);
            fields[i] = 3 + 40 * random_unit(random);
            zooms[i] = 1 + pace * (random_unit(random) - 0.5);
        }
        Cut cut(tree);
        for (int frame = 0; frame < 30; ++frame) {
            Viewpoint viewpoint{.eye = glm::dvec3(sphere.centre) + eye};
            for (std::size_t i = 0; i < count; ++i) {
                View view;
                view.eye = centre + (i == 0 ? eye : -eye);
                view.target = centre + targets[i];
                view.up = {0.1, 1, 0.05};
                view.fov_y_degrees = std::min(fields[i], 170.0);
                ASSERT_TRUE(validate(view));
                viewpoint.frusta.push_back(frustum_of(tree, view));
                targets[i] += turns[i];
                fields[i] *= zooms[i];
            }
            ASSERT_TRUE(cut.follow(criterion, viewpoint));
            const std::vector<bool> expected = from_scratch(tree, criterion, viewpoint, {});
            ASSERT_EQ(state_of(cut), expected) << "way " << way << ", frame " << frame;
            viewpoint.frusta.clear();
            cut_frames += expected != from_scratch(tree, criterion, viewpoint, {});
            ++all_frames;
            eye += step;
        }
    }
    if (GetParam().has_small_rings) EXPECT_GT(cut_frames, all_frames / 2);
}

// A head that goes around the model, walks past it, turns, and looks elsewhere now and then, with a gaze that is fixed to it
// or trails behind; for both of its eyes every other time.
TEST_P(Follow, EqualsTheCutFromScratchUnderMotionsOfAHead) {
    const VertexTree tree = built(GetParam().make());
    const Sphere sphere = tree.bounding_sphere();
    const double radius = sphere.radius;
    const DistanceCriterion criterion = rich_criterion(tree, 4, true);
    std::mt19937_64 random(37);
    enum { around, past, turning, looking, motions };
    for (int motion = 0; motion < motions; ++motion) {
        const double aside = 0.5 * random_unit(random), up = 0.3 * random_unit(random); // radians
        double angle = 0, look = 0;
        glm::dvec3 eye(0, 0.3 * radius, 3.5 * radius);
        Cut cut(tree);
        for (int frame = 0; frame < frame_count() / motions; ++frame) {
            const double pace = std::pow(10.0, -1.5 - 3 * (frame / 25 % 4) / 3.0); // of a radian, or the radius
            if (motion == around) angle += pace;
            if (motion == past) eye.x = radius * std::sin(pace * frame);
            if (motion == turning) look = 0.4 * std::sin(3 * pace * frame);
            if (motion == looking && frame % 9 == 0) look = random_unit(random) - 0.5;
            const glm::dquat turn = glm::angleAxis(angle, glm::normalize(glm::dvec3(0.1, 1, 0.2)));
            const glm::dquat gaze =
                turn * glm::angleAxis(aside + look, glm::dvec3(0, 1, 0)) * glm::angleAxis(up, glm::dvec3(1, 0, 0));
            Viewpoint viewpoint{.eye = glm::dvec3(sphere.centre) + turn * eye};
            viewpoint.gaze = gaze * glm::dvec3(0, 0, -1);
            if (motion % 2 == 1) viewpoint.eye_spread = 0.01 * radius;
            ASSERT_TRUE(cut.follow(criterion, viewpoint));
            ASSERT_EQ(state_of(cut), from_scratch(tree, criterion, viewpoint, {}))
                << "motion " << motion << ", frame " << frame;
        }
    }
}

// The eccentricity of what turns with the view stays, so a gaze that is fixed to a camera costs little more than none.
TEST(FollowGaze, WakesFewNodesWhereItGoesWithTheCamera) {
    const VertexTree tree = built(shapes::bumpy_sphere(5, 0.03));
    std::array<std::uint64_t, 2> tests{};
    std::uint64_t watched = 0;
    constexpr int frames = 90;
    for (const bool with_gaze : {false, true}) {
        DistanceCriterion::Parts parts;
        parts.eccentricity_bins = with_gaze ? 80 : 1;
        for (std::size_t bin = 0; bin < parts.eccentricity_bins; ++bin)
            parts.switch_distance.push_back(with_gaze ? static_cast<float>(400 * std::exp(-0.04 * double(bin))) : 130);
        const auto criterion = require(DistanceCriterion::create(tree, std::move(parts)));
        Cut cut(tree);
        for (int frame = 0; frame < frames; ++frame) {
            const glm::dquat turn = glm::angleAxis(frame * M_PI / 180, glm::dvec3(0, 1, 0));
            Viewpoint viewpoint{.eye = turn * glm::dvec3(0, 0, 8)};
            if (with_gaze) viewpoint.gaze = turn * glm::normalize(glm::dvec3(0.5, 0.1, -1));
            const auto stats = require(cut.follow(*criterion, viewpoint));
            if (frame >= 2) tests[with_gaze] += stats->node_tests;
        }
        watched = cut.triangle_count() / 2;
    }
    EXPECT_LT(tests[1], 8 * tests[0]);
    EXPECT_LT(tests[1], frames * watched / 10); // an eighth of what a bound on all motion wakes
}

// How much more than a block's the angle of a point in it may change, by its motion in doubles.
TEST(FollowGaze, BlocksBoundHowEccentricitiesOfTheirNodesChange) {
    std::mt19937_64 random(41);
    const auto angle = [](const glm::dvec3& a, const glm::dvec3& b) {
        return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
    };
    const VertexTree tree = built(shapes::bumpy_sphere(3));
    double tightest = std::numeric_limits<double>::infinity();
    for (int run = 0; run < 4000; ++run) {
        Viewpoint from{.eye = 5.0 * random_direction(random)}, to = from;
        from.gaze = run % 4 == 0 ? glm::normalize(-from.eye) : random_direction(random);
        const double pace = std::pow(10.0, -4 * random_unit(random));
        const glm::dquat turn = glm::angleAxis(pace, random_direction(random));
        if (run % 3 != 0) to.eye += pace * random_direction(random);
        if (run % 3 == 2) to.eye = turn * from.eye;
        to.gaze = run % 5 == 0 ? *from.gaze : turn * *from.gaze;
        const GazeMotion motion = gaze_motion(tree, from, to);
        BlockArrays spheres;
        GazeArrays blocks;
        spheres.for_each([](auto& values, float fill) { values.assign(whole_registers(1), fill); });
        blocks.for_each([](auto& values, float fill) { values.assign(whole_registers(1), fill); });
        const glm::vec3 centre(random_unit(random) * random_direction(random));
        const double radius = std::pow(10.0, -3 * random_unit(random));
        spheres.set_sphere(0, centre, static_cast<float>(radius), 0);
        const double before = angle(glm::dvec3(centre) - from.eye, *from.gaze);
        blocks.angle[0] = static_cast<float>(before);
        blocks.outward[0] = 1e9f; // used
        std::uint64_t due = 0;
        deadline_kernel.turn_blocks(motion, spheres, blocks, &due);
        const double after = angle(glm::dvec3(centre) - to.eye, *to.gaze);
        ASSERT_NEAR(static_cast<double>(blocks.angle[0]), after, 2e-6) << run;
        for (int i = 0; i < 20; ++i) {
            const glm::dvec3 p =
                glm::dvec3(centre) + radius * (i < 10 ? 1 : random_unit(random)) * random_direction(random);
            const double change = angle(p - to.eye, *to.gaze) - angle(p - from.eye, *from.gaze) - (after - before);
            ASSERT_LE(std::abs(change), static_cast<double>(blocks.error[0])) << run;
            if (std::abs(change) > 1e-4)
                tightest = std::min(tightest, static_cast<double>(blocks.error[0]) / std::abs(change));
        }
    }
    EXPECT_LT(tightest, 2); // else it would be no use
}

// What one cut for several eyes keeps: all that the cut of any of them has, whatever the criterion, gazes, back faces and
// occluders; and it is followed like others.
TEST_P(Follow, KeepsForAllEyesWithinTheSpreadWhatOneOfThemNeeds) {
    const VertexTree tree = built(GetParam().make());
    const Sphere sphere = tree.bounding_sphere();
    std::mt19937_64 random(37);
    std::ptrdiff_t of_all = 0, of_one = 0;
    for (unsigned variant = 0; variant < 8; ++variant) {
        const bool with_gaze = variant & 1, with_occluders = variant & 2, without_backs = variant & 4;
        const DistanceCriterion criterion = rich_criterion(tree, 6 + variant, with_gaze);
        FollowOptions options;
        options.cull_back_faces = without_backs && tree.closedness() != Closedness::open;
        Path path(tree, 41 + variant, with_gaze, false);
        if (with_occluders) path.put_occluders();
        const double spread = static_cast<double>(sphere.radius) * std::pow(10.0, -0.5 - 2 * random_unit(random));
        Cut cut(tree);
        for (int frame = 0; frame < frame_count() / 8; ++frame) {
            Viewpoint viewpoint = path.next();
            std::erase_if(viewpoint.occluders, [&](const Sphere& s) {
                return !(glm::distance(glm::dvec3(s.centre), viewpoint.eye) > 1.001 * spread + s.radius);
            });
            viewpoint.eye_spread = spread;
            ASSERT_TRUE(cut.follow(criterion, viewpoint, options));
            const std::vector<bool> kept = state_of(cut);
            ASSERT_EQ(kept, from_scratch(tree, criterion, viewpoint, options)) << "frame " << frame;
            of_all += std::count(kept.begin(), kept.end(), true);
            Viewpoint one = viewpoint;
            one.eye_spread = 0;
            one.eye += (frame % 4 == 0 ? 1 : random_unit(random)) * spread * random_direction(random);
            const std::vector<bool> needed = from_scratch(tree, criterion, one, options);
            of_one += std::count(needed.begin(), needed.end(), true);
            for (std::size_t node = 0; node < needed.size(); ++node)
                ASSERT_TRUE(kept[node] || !needed[node]) << "node " << node << ", frame " << frame << ", " << variant;
        }
    }
    EXPECT_GT(of_all, of_one); // else the spread did nothing
}

TEST(FollowCriterion, KnowsWhetherItIsMonotone) {
    const VertexTree tree = built(shapes::bumpy_sphere(2));
    DistanceCriterion::Parts parts = rich_criterion(tree, 3, false).parts();
    EXPECT_TRUE(require(DistanceCriterion::create(tree, parts))->is_monotone());
    parts.classes[VertexTree::root()] = {};
    EXPECT_FALSE(require(DistanceCriterion::create(tree, parts))->is_monotone());
}

// Decisions and costs of many nodes at once are those of the tests one by one.
TEST_P(Follow, DecidesAndWeighsManyNodesAsOneByOne) {
    const VertexTree tree = built(GetParam().make());
    std::vector<NodeId> nodes(tree.interior_count()), shuffled;
    for (NodeId node = 0; node < nodes.size(); ++node) nodes[node] = node;
    shuffled = nodes;
    std::mt19937_64 random(23);
    std::shuffle(shuffled.begin(), shuffled.end(), random);
    const auto bit = [](const std::vector<std::uint64_t>& bits, std::size_t i) {
        return ((bits[i / 64] >> (i % 64)) & 1) != 0;
    };
    for (int variant = 0; variant < 24; ++variant) {
        const bool with_gaze = variant & 1, with_frustum = variant & 2, cull = variant & 4;
        DistanceCriterion::Parts parts =
            rich_criterion(tree, 3 + static_cast<std::uint64_t>(variant & 8 ? 1 : 0), with_gaze).parts();
        if (variant >= 12) { // other spheres, directions of its own, least costs
            parts.spheres = DistanceCriterion::Spheres::support;
            for (const NodeBounds& bounds : tree.bounds()) parts.facing.push_back(bounds.slabs);
            parts.least_cost.assign(parts.switch_distance.size(), 0.5f);
        }
        const auto criterion = require(DistanceCriterion::create(tree, std::move(parts)));
        Path path(tree, 31 + static_cast<std::uint64_t>(variant), with_gaze, with_frustum);
        for (int frame = 0; frame < 12; ++frame) {
            Viewpoint viewpoint = path.next();
            if (frame % 3 == 0)
                viewpoint.eye = glm::dvec3(
                    tree.position(static_cast<NodeId>(random() % tree.node_count()))); // inside of many rings
            const FollowOptions options{.threshold = 0.7f, .cull_back_faces = cull};
            const auto every = require(test_every_node(tree, *criterion, viewpoint, options));
            FoldTester tester(tree, *criterion, cull, options.threshold);
            tester.look_from(viewpoint, 1);
            std::vector<FoldCandidate> candidates;
            for (const NodeId node : shuffled) candidates.push_back(tester.candidate(node));
            std::vector<Verdict> verdicts(nodes.size());
            tester.test(candidates, verdicts);
            std::vector<std::uint64_t> decided((nodes.size() + 63) / 64), unfolded(decided.size());
            std::vector<float> cost(nodes.size()), seen_cost(nodes.size());
            tester.decide(shuffled, decided.data());
            tester.find_costs(shuffled, {cost.data(), seen_cost.data(), unfolded.data()});
            for (std::size_t i = 0; i < shuffled.size(); ++i) {
                ASSERT_EQ(bit(decided, i), verdicts[i].unfolded) << "variant " << variant << ", node " << shuffled[i];
                ASSERT_EQ(bit(*every, shuffled[i]), verdicts[i].unfolded)
                    << "variant " << variant << ", node " << shuffled[i];
                ASSERT_EQ(bit(unfolded, i), verdicts[i].unfolded) << "variant " << variant << ", node " << shuffled[i];
                expect_cost_by_definition(*criterion, candidates[i], viewpoint, cost[i], seen_cost[i]);
                // A cost that is not just the threshold tells the verdict.
                if (std::abs(seen_cost[i] - options.threshold) > 1e-4f * options.threshold)
                    ASSERT_EQ(seen_cost[i] > options.threshold, verdicts[i].unfolded)
                        << "variant " << variant << ", node " << shuffled[i];
            }
            if (HasFatalFailure()) return;
        }
    }
}

TEST_P(Follow, PatchesTheIndexBufferAndTellsACopyWhatChanges) {
    const VertexTree tree = built(GetParam().make());
    const DistanceCriterion criterion = rich_criterion(tree, 4, false);
    const Sphere sphere = tree.bounding_sphere();
    Cut cut(tree);
    support::GpuCopy copy(tree);
    int told = 0;
    for (int frame = 0; frame < 120; ++frame) {
        const double angle = frame * 0.002, distance = sphere.radius * (6 + std::sin(frame * 0.05));
        const Viewpoint viewpoint{.eye = glm::dvec3(sphere.centre) +
                                         distance * glm::dvec3(std::sin(angle), 0.2, std::cos(angle))};
        ASSERT_TRUE(cut.follow(criterion, viewpoint));
        told += copy.update(cut);
        const auto triangles = support::sorted_triangles(cut);
        ASSERT_EQ(copy.sorted_triangles(), triangles) << "frame " << frame;
        Cut fresh(tree);
        ASSERT_TRUE(fresh.follow(criterion, viewpoint));
        ASSERT_EQ(support::sorted_triangles(fresh), triangles) << "frame " << frame;
    }
    EXPECT_GT(told, 60);
}

// By distances alone, so that tests of planes would show: where a camera's frustum shows all of the model, they are
// seldom.
TEST(FollowFrustum, AddsHardlyATestWhereItShowsAllOfTheModel) {
    const VertexTree tree = built(shapes::bumpy_sphere(5, 0.03));
    const Sphere sphere = tree.bounding_sphere();
    DistanceCriterion::Parts parts;
    parts.switch_distance = {40};
    const auto criterion = require(DistanceCriterion::create(tree, std::move(parts)));
    std::uint64_t tests[2] = {};
    Cut cuts[2] = {Cut(tree), Cut(tree)};
    constexpr int frames = 90, warm_up = 2; // then there are deadlines
    for (int degrees = 0; degrees < frames; ++degrees) {
        const double angle = degrees * std::numbers::pi / 180;
        const View view = frame_sphere(tree.origin() + glm::dvec3(sphere.centre), sphere.radius,
                                       {std::sin(angle), 0.3, std::cos(angle)}, 0.9, {});
        Viewpoint viewpoint{.eye = eye_in_tree(tree, view, {})};
        for (const bool with_frustum : {false, true}) {
            if (with_frustum) viewpoint.frusta = {frustum_of(tree, view)};
            const auto stats = require(cuts[with_frustum].follow(*criterion, viewpoint));
            if (degrees >= warm_up) tests[with_frustum] += stats->node_tests;
        }
        ASSERT_EQ(state_of(cuts[0]), state_of(cuts[1])) << degrees << " degrees";
    }
    EXPECT_GT(cuts[0].triangle_count(), tree.triangle_count() / 8);
    EXPECT_LT(cuts[0].triangle_count(), tree.triangle_count());
    EXPECT_GT(tests[0], std::uint64_t{frames});
    EXPECT_LE(static_cast<double>(tests[1]), 1.1 * static_cast<double>(tests[0]));
}

TEST(FollowChanges, ReplayToTheSameCut) {
    const VertexTree tree = built(shapes::torus(40, 20));
    const DistanceCriterion criterion = rich_criterion(tree, 6, false);
    Path path(tree, 12, false, true);
    Cut cut(tree), replica(tree);
    for (int frame = 0; frame < 200; ++frame) {
        ASSERT_TRUE(cut.follow(criterion, path.next()));
        for (const FoldChange& change : cut.changes())
            ASSERT_TRUE(change.folded ? replica.fold(change.node) : replica.unfold(change.node));
        ASSERT_EQ(state_of(cut), state_of(replica)) << "frame " << frame;
    }
}

TEST(FollowBudget, StopsAtCostZeroUnlessToldToFill) {
    const VertexTree tree = built(shapes::bumpy_sphere(3));
    DistanceCriterion::Parts parts;
    parts.switch_distance = {DistanceCriterion::never_visible};
    const auto invisible = require(DistanceCriterion::create(tree, parts));
    Cut cut(tree);
    ASSERT_TRUE(cut.follow(*invisible, {.eye = {5, 0, 0}}, {.triangle_budget = 200}));
    EXPECT_EQ(cut.triangle_count(), 0u);
    ASSERT_TRUE(cut.follow(*invisible, {.eye = {5, 0, 0}}, {.triangle_budget = 200, .fill_budget = true}));
    EXPECT_GT(cut.triangle_count(), 190u);
    EXPECT_LE(cut.triangle_count(), 200u);
}

TEST(FollowBudget, WithHysteresisStaysWithinItsFactorAndDoesNotFlicker) {
    const VertexTree tree = built(shapes::bumpy_sphere(5, 0.02));
    const DistanceCriterion criterion = rich_criterion(tree, 9, false);
    const Sphere sphere = tree.bounding_sphere();
    constexpr Index budget = 4000;
    constexpr float hysteresis = 1.1f;
    Cut steady(tree), exact(tree);
    // Flicker: folds that are undone within ten frames. Once an outline that passes over a node may do that.
    std::map<NodeId, int> folded_at, undone;
    int flickers = 0, folds = 0;
    for (int frame = 0; frame < 240; ++frame) {
        const double angle = frame * 0.01;
        const Viewpoint viewpoint{.eye = glm::dvec3(sphere.centre) +
                                         4.0 * sphere.radius * glm::dvec3(std::sin(angle), 0.3, std::cos(angle))};
        const auto with = steady.follow(criterion, viewpoint, {.triangle_budget = budget, .hysteresis = hysteresis});
        const auto without = exact.follow(criterion, viewpoint, {.triangle_budget = budget});
        ASSERT_TRUE(with && without);
        ASSERT_LE(with->triangles, budget) << "frame " << frame;
        ASSERT_LE(with->max_fold_cost, hysteresis * without->max_fold_cost * 1.0001f) << "frame " << frame;
        for (const FoldChange& change : steady.changes()) {
            if (change.folded) {
                folded_at[change.node] = frame;
                ++folds;
                continue;
            }
            const auto folded = folded_at.find(change.node);
            if (folded != folded_at.end() && frame - folded->second <= 10) flickers += ++undone[change.node] > 1;
        }
        ASSERT_EQ(triangles_of(steady.indices()), gathered(steady)) << "frame " << frame;
    }
    EXPECT_GT(folds, 100);
    EXPECT_LT(flickers, folds / 100) << flickers << " of " << folds;
}

TEST(FollowBudget, WithMuchHysteresisIsStillFollowed) {
    const VertexTree tree = built(shapes::bumpy_sphere(5, 0.02));
    const DistanceCriterion criterion = rich_criterion(tree, 9, false);
    const Sphere sphere = tree.bounding_sphere();
    constexpr Index budget = 4000;
    for (const float hysteresis : {1.1f, 1.5f, 2.0f}) {
        Cut steady(tree), exact(tree);
        std::uint64_t tests = 0, tests_from_scratch = 0;
        for (int frame = 0; frame < 60; ++frame) {
            const double angle = frame * 0.002;
            const Viewpoint viewpoint{.eye = glm::dvec3(sphere.centre) +
                                             4.0 * sphere.radius * glm::dvec3(std::sin(angle), 0.3, std::cos(angle))};
            const auto with =
                steady.follow(criterion, viewpoint, {.triangle_budget = budget, .hysteresis = hysteresis});
            const auto without = exact.follow(criterion, viewpoint, {.triangle_budget = budget});
            ASSERT_TRUE(with && without);
            ASSERT_LE(with->triangles, budget) << "frame " << frame;
            ASSERT_LE(with->max_fold_cost, hysteresis * without->max_fold_cost * 1.0001f) << "frame " << frame;
            if (frame < 2) continue; // the cut, and what to watch
            tests += with->node_tests;
            tests_from_scratch += without->node_tests;
        }
        EXPECT_LT(tests, tests_from_scratch / 4) << "hysteresis " << hysteresis;
    }
}

// The largest cost of a folded node under unfolded ones (or of the root).
float largest_cost_of(const Cut& cut, const DistanceCriterion& criterion, const Viewpoint& viewpoint) {
    const auto costs = require(find_every_cost(cut.tree(), criterion, viewpoint));
    float largest = 0;
    for (NodeId node = 0; node < cut.tree().interior_count();
         node = cut.is_wanted(node) ? node + 1 : support::sound(cut.tree()).subtree_end()[node])
        if (!cut.is_wanted(node)) largest = std::max(largest, (*costs)[node]);
    return largest;
}

// Even without any time every call does a step of tests and one of unfolds, and none does again what one before it has
// done.
TEST(FollowInTime, AStillViewIsDoneInSmallStepsWithoutTestsInVain) {
    const VertexTree tree = built(shapes::bumpy_sphere(5, 0.02));
    for (const bool with_gaze : {false, true}) {
        const DistanceCriterion criterion = rich_criterion(tree, 10, with_gaze);
        Viewpoint viewpoint{.eye = {2, 1, 2}};
        if (with_gaze) viewpoint.gaze = glm::normalize(glm::dvec3(-2, -1, -2));
        Cut whole(tree), hurried(tree);
        const auto at_once = require(whole.follow(criterion, viewpoint));
        std::uint64_t tests = 0, unfolds = 0;
        std::size_t calls = 0;
        for (bool is_complete = false; !is_complete && calls < 10000; ++calls) {
            const auto stats = require(hurried.follow(criterion, viewpoint, {.milliseconds = 0.0}));
            is_complete = stats->is_complete;
            tests += stats->node_tests;
            unfolds += stats->unfolds;
            EXPECT_EQ(stats->folds, 0u);
            ASSERT_EQ(support::fault_in_cut(hurried), "");
        }
        EXPECT_EQ(state_of(hurried), state_of(whole));
        EXPECT_EQ(unfolds, at_once->unfolds);
        EXPECT_LT(tests, 2 * at_once->node_tests);
        EXPECT_LT(calls, at_once->unfolds / 8);
    }
}

// A moving view has something to test in every frame; still the cut gets as fine as where there is time enough.
TEST(FollowInTime, TestsDoNotKeepAMovingCutFromUnfolding) {
    const VertexTree tree = built(shapes::bumpy_sphere(5, 0.02));
    const DistanceCriterion criterion = rich_criterion(tree, 10, false);
    Cut whole(tree), hurried(tree);
    for (int frame = 0; frame < 2000; ++frame) {
        const double angle = frame * 0.02;
        const Viewpoint viewpoint{.eye = 4.0 * glm::dvec3(std::sin(angle), 0.3, std::cos(angle))};
        const auto followed = hurried.follow(criterion, viewpoint, {.milliseconds = 0.0});
        ASSERT_TRUE(followed && whole.follow(criterion, viewpoint));
        if (frame > 0 && hurried.triangle_count() < whole.triangle_count() / 2)
            EXPECT_GT(followed->unfolds, 0u) << "frame " << frame;
    }
    EXPECT_GT(hurried.triangle_count(), whole.triangle_count() / 2);
}

TEST(FollowInTime, TellsTheLargestCostOfWhatItLeaves) {
    const VertexTree tree = built(shapes::bumpy_sphere(5, 0.02));
    const DistanceCriterion criterion = rich_criterion(tree, 10, false);
    Viewpoint viewpoint{.eye = {2, 1, 2}};
    for (const std::optional<Index> budget : {std::optional<Index>(), std::optional<Index>(6000)}) {
        Cut cut(tree);
        int finite = 0, calls = 0;
        for (int moves = 0; moves < 4; ++moves) {
            bool is_complete = false;
            for (; !is_complete && calls < 10000; ++calls) {
                const FollowOptions options{
                    .triangle_budget = budget, .hysteresis = budget ? 1.1f : 1, .milliseconds = 0.0};
                const auto stats = require(cut.follow(criterion, viewpoint, options));
                const float largest = largest_cost_of(cut, criterion, viewpoint);
                ASSERT_GE(stats->max_fold_cost, largest * (1 - 1e-5f)) << "call " << calls; // the rounding of a test
                EXPECT_LE(stats->triangles, budget.value_or(tree.triangle_count()));
                is_complete = stats->is_complete;
                finite += !is_complete && std::isfinite(stats->max_fold_cost);
                EXPECT_TRUE(!is_complete || budget || stats->max_fold_cost <= 1);
            }
            viewpoint.eye += glm::dvec3(-0.1, 0.05, 0);
        }
        EXPECT_GT(finite, calls / 10);
    }
}

// From inside, where every fold is seen from anywhere, to where few are.
TEST(FollowBudget, WithHysteresisComesBackFromInfiniteCosts) {
    const VertexTree tree = built(shapes::bumpy_sphere(5, 0.02));
    const DistanceCriterion criterion = rich_criterion(tree, 9, false);
    constexpr Index budget = 60;
    constexpr float hysteresis = 1.1f;
    Cut steady(tree), exact(tree), replica(tree);
    int fewer = 0;
    for (int frame = 0; frame < 400; ++frame) {
        const Viewpoint viewpoint{.eye = {0.3 + 0.01 * frame, 0, 0}};
        const auto with = steady.follow(criterion, viewpoint, {.triangle_budget = budget, .hysteresis = hysteresis});
        const auto without = exact.follow(criterion, viewpoint, {.triangle_budget = budget});
        ASSERT_TRUE(with && without);
        EXPECT_LE(with->triangles, budget) << "frame " << frame;
        fewer += with->triangles < without->triangles / 2;
        // Whatever the call did in between: one list of all changes.
        std::uint64_t folds = 0;
        for (const FoldChange& change : steady.changes()) {
            ASSERT_TRUE(change.folded ? replica.fold(change.node) : replica.unfold(change.node)) << "frame " << frame;
            folds += change.folded;
        }
        ASSERT_EQ(state_of(steady), state_of(replica)) << "frame " << frame;
        EXPECT_EQ(with->folds, folds);
        EXPECT_EQ(with->unfolds, steady.changes().size() - folds);
        ASSERT_EQ(triangles_of(steady.indices()), gathered(steady)) << "frame " << frame;
    }
    EXPECT_LT(fewer, 10);
}

TEST(FollowScene, SharesABudgetAmongObjects) {
    const VertexTree near_tree = built(shapes::bumpy_sphere(4, 0.03)), far_tree = built(shapes::torus(40, 20));
    const DistanceCriterion near_criterion = rich_criterion(near_tree, 1, false),
                            far_criterion = rich_criterion(far_tree, 2, false);
    Cut near_cut(near_tree), far_cut(far_tree);
    const SceneObject objects[] = {{near_cut, near_criterion, {.eye = {3, 0, 0}}},
                                   {far_cut, far_criterion, {.eye = {0, 40, 9}}}};
    const auto stats = require(follow_scene(objects, 2000));
    EXPECT_LE(near_cut.triangle_count() + far_cut.triangle_count(), 2000u);
    EXPECT_GT(near_cut.triangle_count() + far_cut.triangle_count(), 1900u);
    // The same threshold for both: neither alone would do better within its share.
    Cut alone(near_tree);
    const auto own =
        require(alone.follow(near_criterion, {.eye = {3, 0, 0}}, {.triangle_budget = near_cut.triangle_count()}));
    EXPECT_EQ(state_of(alone), state_of(near_cut));
    const SceneObject twice[] = {{near_cut, near_criterion, {}}, {near_cut, near_criterion, {}}};
    EXPECT_FALSE(follow_scene(twice, 10));
}

// Whether a triangle of a surface that is turned inside out shows its seen side, the one that its normal points away
// from; of others, the one that it points to.
bool is_seen(const VertexTree& tree, const Triangle& t, glm::dvec3 eye) {
    const auto at = [&](Index leaf) { return glm::dvec3(tree.positions()[tree.wedge_of_leaf(leaf)]); };
    const glm::dvec3 normal = glm::cross(at(t[1]) - at(t[0]), at(t[2]) - at(t[0]));
    const double towards = glm::dot(normal, eye - at(t[0]));
    return tree.closedness() == Closedness::closed_inward ? towards < 0 : towards > 0;
}

// Back-face folding goes by the side that is seen: the same nodes fold as on the same surface turned right.
TEST(FollowBackFaces, OfInsideOutSurfacesAreThoseOfTheSurfaceTurnedRight) {
    const Mesh outward = shapes::bumpy_sphere(5, 0);
    const VertexTree right = built(outward, ClustererKind::octree),
                     wrong = built(shapes::inside_out(outward), ClustererKind::octree);
    ASSERT_EQ(right.closedness(), Closedness::closed_outward);
    ASSERT_EQ(wrong.closedness(), Closedness::closed_inward);
    ASSERT_EQ(right.interior_count(), wrong.interior_count());
    const auto for_right = require(DistanceCriterion::create(right, {.switch_distance = {1000}})),
               for_wrong = require(DistanceCriterion::create(wrong, {.switch_distance = {1000}}));
    const FollowOptions culling{.cull_back_faces = true};
    Cut of_right(right), of_wrong(wrong), with_back(wrong);
    std::mt19937_64 random(41);
    for (int frame = 0; frame < 60; ++frame) {
        const Viewpoint viewpoint{.eye = (1.5 + 4 * random_unit(random)) * random_direction(random)};
        ASSERT_TRUE(of_right.follow(*for_right, viewpoint, culling));
        ASSERT_TRUE(of_wrong.follow(*for_wrong, viewpoint, culling));
        ASSERT_TRUE(with_back.follow(*for_wrong, viewpoint));
        EXPECT_EQ(state_of(of_wrong), state_of(of_right)) << "frame " << frame;
        EXPECT_EQ(state_of(of_wrong), from_scratch(wrong, *for_wrong, viewpoint, culling)) << "frame " << frame;
        // What folds for facing away shows no triangle of the surface, whose hidden half is folded for the most part.
        Index hidden = 0;
        for (Index t = 0; t < wrong.triangle_count(); ++t) {
            const Triangle& corners = support::sound(wrong).triangles()[t];
            const bool is_hidden = std::any_of(corners.begin(), corners.end(), [&](Index leaf) {
                const NodeId parent = support::sound(wrong).parents()[wrong.place_of_leaf(leaf)];
                return with_back.is_wanted(parent) && !of_wrong.is_wanted(parent);
            });
            hidden += is_hidden;
            ASSERT_FALSE(is_hidden && is_seen(wrong, corners, viewpoint.eye))
                << "frame " << frame << ", triangle " << t;
        }
        EXPECT_GT(hidden, wrong.triangle_count() / 8) << "frame " << frame;
    }
}

TEST(FollowFarAway, FoldsToNothing) {
    const VertexTree tree = built(shapes::bumpy_sphere(4));
    const auto criterion = require(extent_criterion(tree, View{}, 1));
    Cut cut(tree);
    ASSERT_TRUE(cut.follow(*criterion, {.eye = {3, 0, 0}}));
    EXPECT_GT(cut.triangle_count(), 0u);
    ASSERT_TRUE(cut.follow(*criterion, {.eye = {1e9, 0, 0}}));
    EXPECT_EQ(cut.triangle_count(), 0u);
}

TEST(FollowBadInput, ACriterionOfAnotherTreeIsRefused) {
    const VertexTree tree = built(shapes::bumpy_sphere(4)), other = built(shapes::bumpy_sphere(2));
    const DistanceCriterion criterion = rich_criterion(other, 2, false);
    const Viewpoint viewpoint{.eye = {3, 0, 0}};
    Cut cut(tree), fits(other);
    EXPECT_FALSE(cut.follow(criterion, viewpoint));
    EXPECT_FALSE(cut.follow(criterion, viewpoint, {.triangle_budget = 100}));
    EXPECT_FALSE(test_every_node(tree, criterion, viewpoint));
    EXPECT_FALSE(find_every_cost(tree, criterion, viewpoint));
    const SceneObject objects[] = {{fits, criterion, viewpoint}, {cut, criterion, viewpoint}};
    EXPECT_FALSE(follow_scene(objects, 100));
    EXPECT_EQ(cut.triangle_count() + fits.triangle_count(), 0u);
    EXPECT_TRUE(fits.follow(criterion, viewpoint));
}

TEST(FollowLifetimes, ACutAndItsCopiesOutliveTheTreeGiven) {
    auto tree = std::make_unique<VertexTree>(built(shapes::bumpy_sphere(3)));
    const DistanceCriterion criterion = rich_criterion(*tree, 2, false);
    Cut cut(*tree), expected(*tree);
    ASSERT_TRUE(cut.follow(criterion, {.eye = {3, 0, 0}}));
    static_cast<void>(cut.indices());
    const VertexTree kept = std::move(*tree);
    tree.reset();
    Cut moved = std::move(cut);
    ASSERT_TRUE(moved.follow(criterion, {.eye = {3, 0.01, 0}}));
    ASSERT_TRUE(expected.follow(criterion, {.eye = {3, 0.01, 0}}));
    EXPECT_EQ(std::addressof(moved.tree().data()), std::addressof(kept.data()));
    EXPECT_EQ(state_of(moved), state_of(expected));
    EXPECT_EQ(triangles_of(moved.indices()), gathered(moved));
}

// What folds have taken the last triangle from still has its list when patching is given up in their midst.
TEST(FollowIndices, PatchingThatIsGivenUpLeavesNoListsBehind) {
    Mesh halves = leaves(200); // one triangle of each
    for (std::size_t i = 0; 2 * i < halves.triangles.size(); ++i) halves.triangles[i] = halves.triangles[2 * i];
    halves.triangles.resize(halves.triangles.size() / 2);
    const VertexTree tree = built(shapes::unwelded(halves));
    Cut whole(tree), folded(tree);
    whole.unfold_all();
    folded.unfold_all();
    std::vector<std::uint64_t> unfolded((tree.interior_count() + 63) / 64);
    std::vector<NodeId> proxies(tree.leaf_count());
    for (NodeId node = 0; node < tree.interior_count(); ++node) unfolded[node / 64] |= std::uint64_t{1} << (node % 64);
    for (Index leaf = 0; leaf < tree.leaf_count(); ++leaf) proxies[leaf] = whole.proxy_of_leaf(leaf);
    IndexBuffer buffer(tree);
    for (const bool gives_up : {true, false}) {
        buffer.gather(unfolded, proxies, whole.triangle_count());
        buffer.make_lists();
        ASSERT_TRUE(buffer.can_patch());
        for (NodeId node = tree.interior_count(); node-- > 0;) {
            if (support::sound(tree).subtree_end()[node] != node + 1) continue; // all children are leaves
            std::vector<NodeId> children;
            tree.for_each_child(node, [&](NodeId child) { children.push_back(child); });
            buffer.fold(node, children);
            folded.fold(node);
        }
        if (gives_up) buffer.drop_lists();
    }
    buffer.end_patch();
    EXPECT_LT(folded.triangle_count(), whole.triangle_count());
    EXPECT_EQ(triangles_of(buffer.indices()), gathered(folded));
}

TEST(FollowBadInput, CriteriaThatDoNotFitAreRefused) {
    const VertexTree tree = built(shapes::bumpy_sphere(3));
    using Parts = DistanceCriterion::Parts;
    EXPECT_FALSE(DistanceCriterion::create(tree, Parts{}));
    EXPECT_FALSE(DistanceCriterion::create(tree, Parts{.switch_distance = {std::nanf("")}}));
    EXPECT_FALSE(DistanceCriterion::create(tree, Parts{.lengths = {1, 2}, .switch_distance = {1}}));
    EXPECT_FALSE(DistanceCriterion::create(
        tree, Parts{.classes = std::vector<FoldClass>(tree.interior_count(), {7, 7}), .switch_distance = {1}}));
    EXPECT_FALSE(DistanceCriterion::create(
        tree, Parts{.lengths = std::vector<float>(tree.interior_count(), -1), .switch_distance = {1}}));
    EXPECT_FALSE(DistanceCriterion::create(tree, Parts{.switch_distance = {1, 2}, .eccentricity_bins = 2}));
    EXPECT_FALSE(extent_criterion(tree, View{}, 0));
    EXPECT_FALSE(displacement_criterion(tree, View{}, std::nan("")));
}

TEST(FollowHardTrees, OneTriangleCoincidentVerticesAndEqualDistances) {
    Mesh fan; // as deep as it has vertices under a clusterer that makes a chain
    for (int i = 0; i < 400; ++i) fan.positions.push_back({std::cos(i * 0.015), std::sin(i * 0.015), 0.001 * i});
    for (Index i = 1; i + 1 < 400; ++i) fan.triangles.push_back({0, i, i + 1});
    const auto chain = [](const ClusterInput& input) -> Result<Clustering> {
        Clustering c;
        const Index n = static_cast<Index>(input.mesh.positions.size());
        c.parents.resize(2 * n - 1);
        c.parents[0] = n;
        for (Index v = 1; v < n; ++v) c.parents[v] = n + v - 1;
        for (Index k = n; k + 1 < 2 * n - 1; ++k) c.parents[k] = k + 1;
        c.parents[2 * n - 2] = 2 * n - 2;
        return c;
    };
    Result<VertexTree> deep = require(build_tree(fan.view(), chain));
    std::vector<VertexTree> trees;
    trees.push_back(std::move(*deep));
    trees.push_back(built(shapes::single_triangle()));
    for (const VertexTree& tree : trees) {
        DistanceCriterion::Parts parts;
        parts.lengths.assign(tree.interior_count(), 0.5f); // all D equal
        parts.switch_distance = {2};
        const auto criterion = require(DistanceCriterion::create(tree, parts));
        Cut cut(tree);
        for (int frame = 0; frame < 300; ++frame) {
            const Viewpoint viewpoint{.eye = {1 + 0.01 * frame, 0.3, 0.2}};
            ASSERT_TRUE(cut.follow(*criterion, viewpoint));
            ASSERT_EQ(state_of(cut), from_scratch(tree, *criterion, viewpoint, {}));
            ASSERT_EQ(triangles_of(cut.indices()), gathered(cut));
        }
        for (const Index budget : {Index{0}, Index{1}, tree.triangle_count(), tree.triangle_count() + 1000})
            EXPECT_TRUE(cut.follow(*criterion, {.eye = {2, 0, 0}}, {.triangle_budget = budget}));
    }
}

TEST(FollowThreads, SeveralCutsShareATree) {
    const VertexTree tree = built(shapes::torus(40, 20));
    const DistanceCriterion criterion = rich_criterion(tree, 3, true);
    std::vector<std::vector<bool>> results(4);
    std::vector<std::thread> threads;
    for (std::size_t i = 0; i < results.size(); ++i) {
        threads.emplace_back([&, i] {
            Path path(tree, 21, true, true);
            path.put_occluders();
            Cut cut(tree);
            for (int frame = 0; frame < 100; ++frame) {
                static_cast<void>(cut.follow(criterion, path.next()));
                static_cast<void>(cut.indices());
            }
            results[i] = state_of(cut);
        });
    }
    for (std::thread& thread : threads) thread.join();
    for (const auto& result : results) EXPECT_EQ(result, results[0]);
}

} // namespace unseen::vdtree::follow_test
