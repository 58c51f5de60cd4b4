// What folds get wrong: nothing where nothing can be wrong, more up the tree, and the same for any number of threads.
#include <unseen/perception/fold_measurement.h>

#include <ctime>

#include <unseen/perception/criterion.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/internal/conserve_light.h>
#include <unseen/vdtree/tree_io.h>
#include <unseen/vdtree/view.h>

#include "fold/fold_errors.h"
#include "measure/fold_picture.h"
#include "measured.h"
#include "shapes.h"
#include "sound.h"
#include "temp_folder.h"
#include "testing.h"

namespace unseen::perception {

using namespace vdtree;

namespace fold_measurement_test {

// Colours are what is drawn.
VertexTree built(const Mesh& mesh) { return support::measured(support::built(mesh, {.prelit = true, .threads = 1})); }

std::vector<FoldError> errors_of(const VertexTree& tree) {
    const auto errors = require(fold_errors_of(support::sound(tree)));
    return errors->of_nodes;
}
std::span<const FoldRecord> records_of(const VertexTree& tree) { return tree.attribute<FoldRecord>(record_name); }

// A flat square of n x n quads whose grey is a function of the place.
template <class Grey>
Mesh painted_square(int n, Grey&& grey) {
    Mesh mesh = shapes::grid(n);
    for (const glm::dvec3& p : mesh.positions) {
        const auto g = static_cast<float>(grey(p));
        mesh.colours.push_back({g, g, g, 1});
    }
    return mesh;
}

// Both are rounded outward, each in its own way: a unit apart at most.
bool includes(const NormalSlabs& all, const NormalSlabs& one) {
    for (std::size_t i = 0; i < NormalSlabs::axis_count; ++i)
        if (all.lo[i] > one.lo[i] + 1 || all.hi[i] < one.hi[i] - 1) return false;
    return true;
}

TEST(FoldErrors, OfAFlatEvenSquareAreNoneInLuminance) {
    const VertexTree tree = built(painted_square(12, [](glm::dvec3) { return 0.5; }));
    for (const FoldError& error : errors_of(tree)) EXPECT_EQ(error.luminance, 0);
}

// The vector areas of a ring add up to the same whatever is in it: an even surface sends out as much light however it
// is folded.
TEST(FoldErrors, OfAnEvenClosedSurfaceShiftNoMean) {
    Mesh mesh = shapes::torus(32, 16);
    mesh.colours.assign(mesh.positions.size(), {0.5f, 0.5f, 0.5f, 1});
    const VertexTree tree = built(mesh);
    for (const FoldError& error : errors_of(tree)) EXPECT_LT(error.bias, 1e-4f); // sums of many areas in floats
    EXPECT_GT(errors_of(tree)[VertexTree::root()].distance, 0);
}

// A step in luminance: nodes on it have all of it as their error, nodes far from it nothing.
TEST(FoldErrors, FindAStep) {
    const VertexTree tree = built(painted_square(16, [](glm::dvec3 p) { return p.x < 0.5 ? 0.2 : 0.8; }));
    const auto errors = errors_of(tree);
    int flat = 0, mixed = 0;
    for (NodeId node = 1; node < tree.interior_count(); ++node) {
        const LuminanceRange ring = tree.ring_luminance()[node], support = tree.support_luminance()[node];
        if (ring.hi - ring.lo < 1e-3f) {
            // Neighbours may fold over the step, which the ring does not see.
            flat += errors[node].luminance < 1e-3f;
        }
        if (support.hi - support.lo > 0.5f) {
            ++mixed;
            EXPECT_GT(errors[node].luminance, 0.15f) << node;
        }
    }
    EXPECT_GT(flat, 20);
    EXPECT_GT(mixed, 2);
}

TEST(FoldErrors, GrowUpTheTreeAndHoldTheirDirections) {
    for (const Mesh& mesh : {shapes::bumpy_sphere(4, 0.05), shapes::random_soup(300, 800, 3), shapes::torus(24, 12)}) {
        const VertexTree tree = built(mesh);
        const auto errors = errors_of(tree);
        for (NodeId node = 1; node < tree.interior_count(); ++node) {
            const NodeId parent = support::sound(tree).parents()[node];
            ASSERT_GE(errors[parent].distance, errors[node].distance);
            ASSERT_GE(errors[parent].extent, errors[node].extent);
            ASSERT_TRUE(errors[parent].facing.includes(errors[node].facing));
        }
        // Every triangle that touches a node's support is among its directions.
        const auto place = [&](Index leaf) { return glm::dvec3(tree.positions()[tree.wedge_of_leaf(leaf)]); };
        for (const Triangle& t : support::sound(tree).triangles()) {
            const glm::dvec3 normal = glm::cross(place(t[1]) - place(t[0]), place(t[2]) - place(t[0]));
            if (!(glm::length(normal) > 1e-9)) continue;
            NormalSlabs own;
            own.insert(glm::normalize(normal));
            for (const Index leaf : t)
                ASSERT_TRUE(includes(errors[support::sound(tree).parents()[tree.place_of_leaf(leaf)]].facing, own));
        }
    }
}

// Whatever was measured, what the model makes of it grows up the tree, and is no less than what was measured.
TEST(FoldErrors, NestWhateverWasMeasured) {
    const VertexTree tree = support::built(shapes::bumpy_sphere(4, 0.05));
    const SoundTree sound = support::sound(tree);
    std::mt19937_64 random(11);
    const auto any = [&] { return static_cast<float>(std::exp2(shapes::random_between(random, -20, 0))); };
    std::vector<FoldRecord> records(tree.interior_count());
    std::vector<FoldFacing> facing(tree.interior_count());
    for (NodeId node = 0; node < records.size(); ++node) {
        FoldRecord& r = records[node];
        r = {any(), any(), any(), any(), any(), any(), any(), any(), {}, any(), any()};
        for (auto& of_size : r.amplitudes)
            for (float& amplitude : of_size) amplitude = any();
        facing[node].is_height_field = random() % 2;
        facing[node].facing.insert(glm::normalize(glm::dvec3(shapes::random_between(random, -1, 1), 0, 0.1)));
    }
    const std::vector<FoldError> errors = nested_errors(sound, records, facing);
    for (NodeId node = 0; node < errors.size(); ++node) {
        const FoldError& e = errors[node];
        EXPECT_GE(e.distance, records[node].shift);
        EXPECT_GE(e.outline, e.distance);
        EXPECT_GE(e.outline, records[node].border);
        EXPECT_GE(e.extent, records[node].extent);
        EXPECT_GE(e.luminance, records[node].amplitudes[1][3]);
        EXPECT_TRUE(e.facing.includes(facing[node].facing));
        if (node == 0) continue;
        const FoldError& above = errors[sound.parents()[node]];
        EXPECT_GE(above.distance, e.distance);
        EXPECT_GE(above.outline, e.outline);
        EXPECT_GE(above.extent, e.extent);
        EXPECT_TRUE(above.facing.includes(e.facing));
    }
}

// Two spheres that pass through each other, and two that do not: where they meet, a fold moves a line like an outline.
TEST(FoldErrors, CountAsOutlinesWherePartsMeet) {
    const auto meeting = [](double apart) {
        const VertexTree tree =
            built(shapes::together(shapes::icosphere(4), shapes::placed(shapes::icosphere(4), 1, {apart, 0, 0})));
        const auto errors = errors_of(tree);
        std::size_t everywhere = 0, near = 0;
        for (NodeId node = 1; node < tree.interior_count(); ++node) {
            const FoldError& error = errors[node];
            const bool is_small = tree.bounds()[node].ring.radius < 0.3f; // larger ones look everywhere by themselves
            if (!is_small || error.facing != NormalSlabs::everything()) continue;
            ++everywhere;
            // The circle in the plane half way between, of radius sqrt(1 - (apart / 2)^2).
            const Sphere ring = tree.bounds()[node].ring;
            const glm::dvec3 at = tree.origin() + glm::dvec3(ring.centre);
            const double across = std::hypot(at.y, at.z) - std::sqrt(std::max(1 - apart * apart / 4, 0.0));
            near += std::hypot(at.x - apart / 2, across) <= 2 * static_cast<double>(ring.radius);
        }
        EXPECT_EQ(near, everywhere);
        return everywhere;
    };
    EXPECT_GT(meeting(1.2), 100u);
    EXPECT_EQ(meeting(2.6), 0u);
}

// A dark shell just over a bright one: wherever a fold moves the one, the other shows over a far wider area.
TEST(FoldErrors, CountFarMoreWherePartsMeetFlat) {
    Mesh inner = shapes::icosphere(4), outer = shapes::placed(shapes::icosphere(4), 1.0005);
    inner.colours.assign(inner.positions.size(), {0.9f, 0.9f, 0.9f, 1});
    outer.colours.assign(outer.positions.size(), {0.1f, 0.1f, 0.1f, 1});
    const VertexTree alone = built(outer), both = built(shapes::together(inner, outer));
    const auto most_of = [](const VertexTree& tree) {
        const auto errors = errors_of(tree);
        float most = 0;
        for (NodeId node = 1; node < tree.interior_count(); ++node)
            if (const float radius = tree.bounds()[node].ring.radius; radius < 0.2f)
                most = std::max(most, errors[node].distance / radius);
        return most;
    };
    EXPECT_GT(most_of(both), 7 * most_of(alone));
}

// A narrow bright ridge, along which all folds lose light: what is drawn when all nodes like one are folded differs by
// no more than was measured of one of them, though no fold does all of it.
TEST(FoldErrors, CountWhatNeighboursAddUpTo) {
    Mesh mesh = shapes::icosphere(5);
    for (const glm::dvec3& p : mesh.positions) {
        const double across = (p.y - 0.2 * p.x) / 0.08;
        const auto grey = static_cast<float>(0.3 + 0.4 * std::exp(-across * across));
        mesh.colours.push_back({grey, grey, grey, 1});
    }
    const VertexTree tree = built(mesh);
    // Each node of a sphere without seams has one wedge, of the same number.
    const auto corner = [&](NodeId node) { return LitPoint{tree.positions()[node], tree.luminance()[node]}; };
    const auto span = [&](NodeId node) {
        return tree.support_luminance()[node].hi - tree.support_luminance()[node].lo;
    };
    const auto is_folded = [&](NodeId node, NodeId with) {
        return tree.support_spheres()[node].radius <= tree.support_spheres()[with].radius &&
               span(node) <= 2 * span(with);
    };
    const auto errors = errors_of(tree);
    std::size_t compared = 0, within = 0;
    for (NodeId node = 1; node < tree.interior_count(); node += 7) {
        const Index leaves = support::sound(tree).leaf_end()[node] - support::sound(tree).first_leaf()[node];
        const FoldError& error = errors[node];
        if (leaves > 16 || error.luminance < 0.02f) continue;
        const float width = std::max(tree.support_spheres()[node].radius, error.extent);
        float counted = 0; // by the nodes that are folded there
        FoldPicture picture;
        picture.look(tree.positions()[node], glm::normalize(tree.positions()[node] + glm::vec3(tree.origin())),
                     1.5f * width);
        for (const Triangle& t : support::sound(tree).triangles()) {
            std::array<NodeId, 3> whole{}, drawn{};
            bool is_near = false;
            for (std::size_t k = 0; k < 3; ++k) {
                whole[k] = drawn[k] = tree.place_of_leaf(t[k]);
                is_near |= glm::distance(tree.positions()[whole[k]], tree.positions()[node]) < 3 * width;
                for (NodeId up = support::sound(tree).parents()[drawn[k]]; up != no_node && is_folded(up, node);
                     up = support::sound(tree).parents()[up])
                    drawn[k] = up;
            }
            if (!is_near) continue;
            for (const NodeId at : drawn)
                if (!tree.is_place(at)) counted = std::max(counted, errors[at].luminance);
            picture.draw(FoldPicture::Layer::mesh, corner(whole[0]), corner(whole[1]), corner(whole[2]));
            picture.draw(FoldPicture::Layer::folded, corner(drawn[0]), corner(drawn[1]), corner(drawn[2]));
        }
        const auto amplitudes = picture.difference().amplitudes[0];
        ++compared;
        within += *std::max_element(amplitudes.begin(), amplitudes.end()) <= 1.25f * counted;
    }
    EXPECT_GT(compared, 20u);
    EXPECT_GE(within * 20, compared * 19) << within << " of " << compared;
}

TEST(FoldErrors, TellHowFarTheyAreAndCanBeCancelledAtAnyTime) {
    const VertexTree tree = built(shapes::bumpy_sphere(4, 0.02));
    std::vector<double> shares;
    ASSERT_TRUE(measure_folds(tree, 1, [&](double share, const char* stage) {
        EXPECT_STREQ(stage, "measuring folds");
        shares.push_back(share);
        return true;
    }));
    EXPECT_TRUE(std::ranges::is_sorted(shares));
    EXPECT_GE(shares.front(), 0);
    EXPECT_LE(shares.back(), 1);
    double widest = 0;
    for (std::size_t i = 1; i < shares.size(); ++i) widest = std::max(widest, shares[i] - shares[i - 1]);
    EXPECT_LT(widest, 0.1) << "in contacts, folds and pictures";
    for (const std::size_t calls : {std::size_t{0}, shares.size() / 4, shares.size() / 2, shares.size() - 1}) {
        std::size_t told = 0;
        const auto cancelled = measure_folds(tree, 1, [&](double, const char*) { return told++ < calls; });
        ASSERT_FALSE(cancelled) << calls;
        EXPECT_EQ(cancelled.error().code, ErrorCode::cancelled);
        EXPECT_EQ(told, calls + 1) << "it stops at once";
    }
}

// Neither as they are built nor with their light conserved.
TEST(FoldErrors, LeaveTheLuminancesAsTheyAre) {
    const VertexTree means = support::built(shapes::with_attributes(shapes::torus(24, 12)));
    const Result<VertexTree> conserved = require(conserve_light(means));
    for (const VertexTree* tree : {&means, &*conserved}) {
        const Result<VertexTree> measured = require(measure_folds(*tree, 1));
        EXPECT_TRUE(has_fold_measurement(*measured));
        EXPECT_TRUE(std::ranges::equal(measured->luminance(), tree->luminance()));
        EXPECT_TRUE(std::ranges::equal(measured->support_luminance(), tree->support_luminance()));
        EXPECT_TRUE(std::ranges::equal(measured->ring_luminance(), tree->ring_luminance()));
        EXPECT_TRUE(std::ranges::equal(measured->adaptation_luminance(), tree->adaptation_luminance()));
    }
}

// Lengths in any unit: the same errors, but for the unit.
TEST(FoldErrors, DoNotDependOnTheUnit) {
    const Mesh mesh = shapes::in_floats(
        shapes::together(shapes::bumpy_sphere(3, 0.03), shapes::placed(shapes::cube(4), 0.5, {0.9, 0.1, 0})));
    const VertexTree tree = built(mesh);
    const auto errors = errors_of(tree);
    const std::span<const FoldRecord> records = records_of(tree);
    for (const int power : {-110, -60, 60, 110}) {
        Mesh other = mesh;
        for (glm::dvec3& p : other.positions) p *= std::ldexp(1.0, power);
        const VertexTree scaled = built(other);
        ASSERT_EQ(scaled.interior_count(), tree.interior_count()) << power;
        ASSERT_TRUE(std::ranges::equal(support::sound(scaled).parents(), support::sound(tree).parents())) << power;
        EXPECT_TRUE(std::ranges::equal(scaled.luminance(), tree.luminance())) << power;
        EXPECT_TRUE(
            std::ranges::equal(scaled.attribute<FoldStage>(stages_name), tree.attribute<FoldStage>(stages_name)))
            << power;
        const auto scaled_errors = errors_of(scaled);
        const std::span<const FoldRecord> scaled_records = records_of(scaled);
        const bool has_few_digits =
            power < -100; // lengths near the least numbers: what is multiplied with them is rounded
        for (NodeId node = 0; node < tree.interior_count(); ++node) {
            FoldRecord record = records[node];
            for (float* length : {&record.shift, &record.farthest, &record.mean_distance, &record.extent, &record.gap,
                                  &record.border, &record.thickness})
                *length = std::ldexp(*length, power);
            ASSERT_EQ(scaled_records[node], record) << "2^" << power << ", node " << node;
            FoldError expected = errors[node];
            for (float* length : {&expected.distance, &expected.mean_distance, &expected.border, &expected.outline,
                                  &expected.extent, &expected.thickness})
                *length = std::ldexp(*length, power);
            if (has_few_digits) {
                EXPECT_NEAR(scaled_errors[node].distance, expected.distance, 1e-3f * expected.distance) << node;
                EXPECT_NEAR(scaled_errors[node].outline, expected.outline, 1e-3f * expected.outline) << node;
                expected.distance = scaled_errors[node].distance, expected.outline = scaled_errors[node].outline;
            }
            ASSERT_EQ(scaled_errors[node], expected) << "2^" << power << ", node " << node;
        }
    }
}

// Attributes of files are looked at by nobody before.
TEST(FoldErrors, AreRefusedWhereTheyAreNone) {
    const VertexTree tree = built(shapes::bumpy_sphere(2, 0.03));
    const auto message = [](const VertexTree& of) {
        const auto criterion = error_distances(of, View{.eye = {0, 0, 3}}, {});
        return criterion ? "" : criterion.error().message;
    };
    const auto with = [&](auto&& change) {
        std::vector<FoldRecord> records(records_of(tree).begin(), records_of(tree).end());
        change(records[1]);
        return message(*tree.with_attribute(record_name, AttributeDomain::interior_node, std::move(records)));
    };
    EXPECT_EQ(with([](FoldRecord&) {}), "");
    constexpr float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
    EXPECT_EQ(with([](FoldRecord& r) { r.gap = infinity; }), "");
    for (const float wrong : {nan, -1.0f, infinity}) {
        for (float FoldRecord::*const value :
             {&FoldRecord::shift, &FoldRecord::farthest, &FoldRecord::mean_distance, &FoldRecord::largest_luminance,
              &FoldRecord::mean_luminance, &FoldRecord::extent, &FoldRecord::sine, &FoldRecord::bias,
              &FoldRecord::border, &FoldRecord::thickness})
            EXPECT_NE(with([&](FoldRecord& r) { r.*value = wrong; }).find("node 1"), std::string::npos);
        EXPECT_NE(with([&](FoldRecord& r) { r.amplitudes[1][2] = wrong; }), "");
    }
    EXPECT_NE(with([](FoldRecord& r) { r.gap = nan; }), "");
    EXPECT_NE(with([](FoldRecord& r) { r.farthest = std::numeric_limits<float>::max(), r.largest_luminance = 1; }), "")
        << "times a factor";

    std::vector<std::uint8_t> stage_of(tree.interior_count(), 255);
    EXPECT_NE(message(*tree.with_attribute(stage_of_name, AttributeDomain::interior_node, stage_of))
                  .find("stage that is not there"),
              std::string::npos);
    std::vector<FoldFacing> facing(tree.interior_count());
    facing[3].fading = 4;
    EXPECT_NE(message(*tree.with_attribute(facing_name, AttributeDomain::interior_node, facing)), "");
    std::vector<FoldStage> stages(tree.attribute<FoldStage>(stages_name).begin(),
                                  tree.attribute<FoldStage>(stages_name).end());
    stages[0].contrast[1][2][3] = nan;
    EXPECT_NE(message(*tree.with_attribute(stages_name, AttributeDomain::tree, stages)).find("contrast"),
              std::string::npos);
    std::vector<float> settings(measurement::settings.begin(), measurement::settings.end());
    settings.back() *= 2;
    EXPECT_NE(message(*tree.with_attribute(settings_name, AttributeDomain::tree, settings)).find("measure them again"),
              std::string::npos);
    EXPECT_NE(
        message(*tree.with_attribute(facing_name, AttributeDomain::tree, std::vector<FoldFacing>(3))).find("missing"),
        std::string::npos);
    EXPECT_NE(message(support::built(shapes::bumpy_sphere(2, 0.03))).find("measure_folds"), std::string::npos);
}

TEST(FoldErrors, AreFiniteForHardMeshes) {
    for (const Mesh& mesh : {shapes::single_triangle(), shapes::with_zero_areas(), shapes::non_manifold_fan(5),
                             shapes::moebius_strip(20), shapes::seam(true)}) {
        const VertexTree tree = built(mesh);
        for (const FoldError& e : errors_of(tree))
            for (const float value : {e.distance, e.mean_distance, e.luminance, e.wide_luminance, e.extent, e.bias})
                ASSERT_TRUE(std::isfinite(value) && value >= 0);
    }
}

// However many triangles meet in one edge: the time goes with them, not with their square.
TEST(FoldErrors, TakeTimeInProportionToAFan) {
    const auto cpu_seconds = [](int pages) {
        const VertexTree tree = support::built(shapes::non_manifold_fan(pages));
        const std::clock_t start = std::clock();
        EXPECT_TRUE(measure_folds(tree));
        return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    };
    const double few = cpu_seconds(200), many = cpu_seconds(1600);
    EXPECT_LT(many, 24 * few) << "8 is linear, 64 the square";
}

TEST(FoldErrors, AreKeptInTheFile) {
    const support::TempFolder folder;
    const VertexTree tree = built(shapes::bumpy_sphere(3, 0.02));
    const auto file = folder / "tree.vdt";
    ASSERT_TRUE(write_tree(file, tree));
    for (const auto& open : {read_tree(file), map_tree(file)}) {
        ASSERT_TRUE(open) << open.error().message;
        EXPECT_TRUE(has_fold_measurement(*open));
        EXPECT_TRUE(std::ranges::equal(records_of(*open), records_of(tree)));
        EXPECT_EQ(errors_of(*open), errors_of(tree));
        EXPECT_FALSE(has_fold_measurement(*open->relit({.direction = {0, 0, 1}})));
    }
    const VertexTree plain = support::built(shapes::bumpy_sphere(3, 0.02));
    EXPECT_FALSE(has_fold_measurement(plain));
}

} // namespace fold_measurement_test
} // namespace unseen::perception
