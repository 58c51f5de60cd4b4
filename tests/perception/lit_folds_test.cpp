// What folds change under lights, against what is measured of a tree that these light.
#include <unseen/perception/internal/lit_folds.h>

#include <unistd.h>

#include <unseen/perception/criterion.h>
#include <unseen/perception/fold_measurement.h>
#include <unseen/vdtree/internal/light_bounds.h>
#include <unseen/vdtree/tree_io.h>

#include "built.h"
#include "measure/fold_record.h"
#include "shapes.h"
#include "testing.h"

namespace unseen::perception::lit_folds_test {

using namespace vdtree;

Lighting one_light(glm::dvec3 direction, double ambient = 0.1) {
    Lighting lighting;
    lighting.ambient = ambient;
    lighting.lights.push_back({.intensity = 0.7, .direction = glm::normalize(direction)});
    return lighting;
}

// A bumpy ball, measured once.
const VertexTree& bumpy() {
    static const VertexTree tree = support::built(shapes::bumpy_sphere(4, 0.04));
    return tree;
}
const LitFolds& folds_of_bumpy() {
    static const LitFolds folds = *require(LitFolds::measure(bumpy()));
    return folds;
}

TEST(LitFolds, LightEveryVertexAsItIsDrawn) {
    const VertexTree tree = support::built(shapes::with_attributes(shapes::torus(16, 8)));
    const auto folds = require(LitFolds::measure(tree));
    const Lighting lighting = one_light({1, 2, 0.5});
    const auto lit = require(folds->under(tree, lighting));
    EXPECT_TRUE(has_fold_measurement(*lit));
    constexpr float half_step = 0.51f / 65535; // of stored luminances
    for (WedgeId w = 0; w < tree.wedge_count(); ++w) {
        const auto drawn = static_cast<float>(lit_luminance(lighting, glm::dvec3(tree.positions()[w]),
                                                            glm::dvec3(glm::vec3(tree.normals()[w])),
                                                            static_cast<double>(albedo_of(tree, w)), glm::dvec3(0)));
        const float stored = lit->luminance()[w];
        ASSERT_NEAR(stored, drawn, half_step) << w;
        ASSERT_GE(lit->luminance_range().hi, stored);
        ASSERT_LE(lit->luminance_range().lo, stored);
    }
}

// Not for every fold: max(0, n.l) bends where the light ends, and vectors along the axes are added up as if each were
// at its worst in one place. But a fold that a measurement under the very light finds visible is found by this one.
TEST(LitFolds, AreHardlyEverLessThanWhatIsMeasuredUnderTheLight) {
    for (const bool is_painted : {false, true}) {
        Mesh mesh = shapes::bumpy_sphere(is_painted ? 3 : 4, 0.04);
        if (is_painted) mesh = shapes::with_attributes(std::move(mesh));
        const VertexTree tree = support::built(mesh, {.crease = 180.0f}); // smooth
        const auto folds = require(LitFolds::measure(tree));
        std::mt19937_64 random(8);
        int all = 0, shorter = 0, compared = 0, less = 0, far_more = 0;
        for (int trial = 0; trial < (is_painted ? 3 : 2); ++trial) {
            const Lighting lighting = one_light(shapes::random_direction(random));
            const VertexTree lit = *folds->under(tree, lighting);
            const VertexTree exact =
                *measure_folds(*tree.shaded([&](WedgeId wedge) { return lit.luminance()[wedge]; }));
            const auto bound = lit.attribute<FoldRecord>(record_name), found = exact.attribute<FoldRecord>(record_name);
            ASSERT_EQ(bound.size(), found.size());
            for (NodeId node = 0; node < tree.interior_count(); ++node) {
                shorter += bound[node].shift < 0.9f * found[node].shift;
                ++all;
                const float most = found[node].amplitudes[0][0];
                if (most < 0.01f) continue;
                ++compared;
                less += bound[node].amplitudes[0][0] < 0.9f * most;
                far_more += bound[node].amplitudes[0][0] > 4 * most;
            }
        }
        EXPECT_LT(shorter, 0.02 * all);
        EXPECT_GT(compared, 500);
        EXPECT_LT(less, 0.02 * compared);
        EXPECT_LT(far_more, 0.3 * compared);
    }
}

// Under several lights, from wherever they come, as many nodes folded. The measurement under the very light folds them
// in another order, and the directions of the lights are few.
TEST(LitFolds, StagesAreHardlyEverLessThanThoseUnderTheLights) {
    const VertexTree& tree = bumpy();
    std::mt19937_64 random(11);
    int compared = 0, less = 0, far_more = 0;
    for (int trial = 0; trial < 2; ++trial) {
        Lighting lighting = one_light(shapes::random_direction(random), 0.2);
        if (trial % 2 == 1)
            lighting.lights.push_back(
                {.intensity = 0.3, .direction = glm::normalize(shapes::random_direction(random))});
        const VertexTree lit = *folds_of_bumpy().under(tree, lighting);
        const VertexTree exact = *measure_folds(*tree.shaded([&](WedgeId wedge) { return lit.luminance()[wedge]; }));
        const auto bound = lit.attribute<FoldStage>(stages_name), found = exact.attribute<FoldStage>(stages_name);
        ASSERT_EQ(bound.size(), found.size());
        for (std::size_t stage = 0; stage < found.size(); ++stage)
            for (std::size_t k = 0; k < FoldStage::backgrounds.size(); ++k)
                for (std::size_t b = 0; b < FoldStage::band_count; ++b) {
                    const auto most = [&](const FoldStage& of) {
                        return *std::max_element(std::begin(of.contrast[k][b]), std::end(of.contrast[k][b]));
                    };
                    if (most(found[stage]) < 0.002f) continue;
                    ++compared;
                    less += most(bound[stage]) < 0.8f * most(found[stage]);
                    far_more += most(bound[stage]) > 8 * most(found[stage]);
                }
    }
    EXPECT_GT(compared, 500);
    EXPECT_LT(less, 0.02 * compared);
    EXPECT_LT(far_more, 0.3 * compared);
}

// Shifts of the mean are those of the light, not of the worst sum over the axes.
TEST(LitFolds, BiasIsThatOfTheLight) {
    const VertexTree& tree = bumpy();
    const VertexTree lit = *folds_of_bumpy().under(tree, one_light({1, 2, 0.5}, 0.2));
    const VertexTree exact = *measure_folds(*tree.shaded([&](WedgeId wedge) { return lit.luminance()[wedge]; }));
    const auto median = [](const VertexTree& of) {
        std::vector<float> all;
        for (const FoldRecord& fold : of.attribute<FoldRecord>(record_name)) all.push_back(fold.bias);
        std::ranges::nth_element(all, all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2));
        return all[all.size() / 2];
    };
    ASSERT_GT(median(exact), 0);
    const float ratio = median(lit) / median(exact); // more: what folds change orders them, and that is a bound here
    EXPECT_GT(ratio, 0.7f);
    EXPECT_LT(ratio, 2.5f);
}

TEST(LitFolds, CostNothingWhereNoLightReaches) {
    const VertexTree tree = support::built(shapes::icosphere(4));
    const auto folds = require(LitFolds::measure(tree));
    const VertexTree lit = *folds->under(tree, one_light({0, 0, 1}, 0.2));
    const auto records = lit.attribute<FoldRecord>(record_name);
    int dark = 0;
    for (NodeId node = 0; node < tree.interior_count(); ++node) {
        const Sphere ring = tree.bounds()[node].ring;
        if (ring.centre.z + 1.2f * ring.radius > -0.2f) continue;
        ++dark;
        EXPECT_EQ(records[node].largest_luminance, 0) << node;
    }
    EXPECT_GT(dark, 100);
}

std::string bytes_of(const VertexTree& tree) {
    std::string all;
    for (const Attribute& info : tree.attributes()) {
        all += info.name + ' ';
        if (info.name == record_name) {
            const auto bytes = std::as_bytes(tree.attribute<FoldRecord>(record_name));
            all.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
        }
        if (info.name == facing_name) {
            const auto bytes = std::as_bytes(tree.attribute<FoldFacing>(facing_name));
            all.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
        }
    }
    return all;
}

TEST(LitFolds, AreTheSameFromAFile) {
    for (const bool is_painted : {false, true}) {
        Mesh mesh = shapes::bumpy_sphere(2, 0.04);
        if (is_painted) mesh = shapes::with_attributes(std::move(mesh));
        const VertexTree tree = support::built(mesh);
        EXPECT_FALSE(has_lit_folds(tree));
        const auto none = LitFolds::of(tree);
        ASSERT_FALSE(none);
        EXPECT_EQ(none.error().code, ErrorCode::invalid_argument);
        const auto folds = require(LitFolds::measure(tree));
        const auto with = require(folds->with_attributes(tree));
        const std::filesystem::path file =
            std::filesystem::temp_directory_path() / ("lit-folds-" + std::to_string(::getpid()) + ".vdt");
        ASSERT_TRUE(write_tree(file, *with));
        const auto read = read_tree(file);
        std::filesystem::remove(file);
        ASSERT_TRUE(read) << read.error().message;
        EXPECT_TRUE(has_lit_folds(*read));
        const auto kept = require(LitFolds::of(*read));
        const Lighting lighting = one_light({1, 2, 0.5});
        EXPECT_TRUE(bytes_of(*folds->under(tree, lighting)) == bytes_of(*kept->under(*read, lighting)));
        EXPECT_FALSE(has_lit_folds(*tree.relit(Light())));
        EXPECT_FALSE(folds->with_attributes(support::built(shapes::icosphere(1))));
    }
}

// As files keep them.
struct Folds {
    using Component = float;
    float values[38];
};
struct Albedo {
    using Component = float;
    float values[10];
};

// What a file says, or what somebody puts there: never a crash, and no number that is none.
TEST(LitFolds, RefuseDamagedAttributes) {
    const VertexTree tree = support::built(shapes::with_attributes(shapes::bumpy_sphere(2, 0.04)));
    const VertexTree with = *LitFolds::measure(tree)->with_attributes(tree);
    const std::size_t nodes = tree.interior_count();
    const auto folds = with.attribute<Folds>("lit_folds");
    const auto albedo = with.attribute<Albedo>("lit_albedo");
    const auto settings = with.attribute<float>("lit_measurement");
    const auto facing = with.attribute<FoldFacing>("lit_facing");
    ASSERT_EQ(folds.size(), nodes);
    ASSERT_EQ(albedo.size(), nodes);
    ASSERT_EQ(facing.size(), nodes);
    const auto complaint = [](const Result<VertexTree>& damaged) {
        EXPECT_TRUE(damaged);
        const auto read = LitFolds::of(*damaged);
        return read ? "" : read.error().message;
    };
    const auto with_folds = [&](std::vector<Folds> values, AttributeDomain domain = AttributeDomain::interior_node) {
        return with.with_attribute("lit_folds", domain, std::move(values));
    };
    const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
    constexpr std::size_t gap = 6, sine = 7;
    for (std::size_t i = 0; i < 38; ++i)
        for (const float value : {nan, -1.0f, infinity, -infinity}) {
            if (i == gap && value == infinity) continue; // nothing is near
            std::vector<Folds> values(folds.begin(), folds.end());
            values[nodes / 2].values[i] = value;
            EXPECT_THAT(complaint(with_folds(values)), HasSubstr("node " + std::to_string(nodes / 2))) << i << value;
        }
    std::vector<Folds> steep(folds.begin(), folds.end());
    steep[0].values[sine] = 1.5f;
    EXPECT_THAT(complaint(with_folds(steep)), HasSubstr("node 0"));
    for (std::size_t i = 0; i < 10; ++i) {
        std::vector<Albedo> values(albedo.begin(), albedo.end());
        values.back().values[i] = nan;
        EXPECT_THAT(complaint(with.with_attribute("lit_albedo", AttributeDomain::interior_node, values)),
                    HasSubstr("node " + std::to_string(nodes - 1)));
    }
    std::vector<FoldFacing> fading(facing.begin(), facing.end());
    fading[1].fading = 9;
    EXPECT_THAT(complaint(with.with_attribute("lit_facing", AttributeDomain::interior_node, fading)),
                HasSubstr("node 1 "));
    const auto stages = with.attribute<FoldStage>("lit_stages");
    const auto stage_of = with.attribute<std::uint8_t>("lit_stage");
    ASSERT_FALSE(stages.empty());
    std::vector<FoldStage> contrasts(stages.begin(), stages.end());
    contrasts.back().contrast[0][0][0] = nan;
    EXPECT_THAT(complaint(with.with_attribute("lit_stages", AttributeDomain::tree, contrasts)), HasSubstr("contrast"));
    contrasts.pop_back();
    EXPECT_THAT(complaint(with.with_attribute("lit_stages", AttributeDomain::tree, contrasts)), HasSubstr("missing"));
    std::vector<std::uint8_t> late(stage_of.begin(), stage_of.end());
    late[2] = 255;
    EXPECT_THAT(complaint(with.with_attribute("lit_stage", AttributeDomain::interior_node, late)),
                HasSubstr("node 2 folds in a stage that is not there"));
    // Cut off, or of another type: attributes of the whole tree have any length.
    for (const std::size_t left : {std::size_t{1}, nodes / 2, nodes - 1}) {
        EXPECT_THAT(complaint(with_folds({folds.begin(), folds.begin() + static_cast<std::ptrdiff_t>(left)},
                                         AttributeDomain::tree)),
                    HasSubstr("missing"));
        EXPECT_THAT(complaint(with.with_attribute(
                        "lit_albedo", AttributeDomain::tree,
                        std::vector<Albedo>(albedo.begin(), albedo.begin() + static_cast<std::ptrdiff_t>(left)))),
                    HasSubstr("missing"));
    }
    EXPECT_THAT(complaint(with.with_attribute("lit_facing", AttributeDomain::interior_node, std::vector<float>(nodes))),
                HasSubstr("missing"));
    for (std::size_t left = 0; left < settings.size(); ++left)
        EXPECT_THAT(complaint(with.with_attribute(
                        "lit_measurement", AttributeDomain::tree,
                        std::vector<float>(settings.begin(), settings.begin() + static_cast<std::ptrdiff_t>(left)))),
                    HasSubstr("other settings"));
    std::vector<float> others(settings.begin(), settings.end());
    others[0] = nan;
    EXPECT_THAT(complaint(with.with_attribute("lit_measurement", AttributeDomain::tree, others)),
                HasSubstr("other settings"));
    EXPECT_EQ(complaint(with.share()), "");
}

TEST(LitFolds, RefuseWhatTheyDoNotKnow) {
    const VertexTree tree = support::built(shapes::icosphere(2)), other = support::built(shapes::icosphere(3));
    const auto folds = require(LitFolds::measure(tree));
    Lighting shiny = one_light({0, 0, 1});
    shiny.specular = 0.1;
    const auto highlights = folds->under(tree, shiny);
    ASSERT_FALSE(highlights);
    EXPECT_EQ(highlights.error().code, ErrorCode::unsupported);
    EXPECT_THAT(highlights.error().message, HasSubstr("highlights"));
    EXPECT_TRUE(folds->under(tree, shiny, glm::dvec3(0, 0, 5)));
    EXPECT_FALSE(folds->under(other, one_light({0, 0, 1})));
    EXPECT_FALSE(folds->under(tree, Lighting()));
    int told = 0;
    const auto cancelled = LitFolds::measure(other, 1, [&](double, const char*) { return ++told < 2; });
    ASSERT_FALSE(cancelled);
    EXPECT_EQ(cancelled.error().code, ErrorCode::cancelled);
}

} // namespace unseen::perception::lit_folds_test
