// What a scene masks: the GPU's elevations against sums by hand, fold tests that masking only relaxes, and pictures of
// bars before and behind a model.
#include <unseen/session_gpu/as_seen.h>

#include <unseen/calibration/light_rig.h>
#include <unseen/perception/internal/judge_tables.h>
#include <unseen/perception/judge.h>
#include <unseen/perception/masking.h>
#include <unseen/render/internal/visibility_passes.h>
#include <unseen/session/load.h>
#include <unseen/session_gpu/gpu_judge.h>
#include <unseen/session_gpu/scene_renderer.h>

#include "built.h"
#include "gl_test.h"
#include "measured.h"
#include "shapes.h"

namespace unseen::session::masking_test {

using Elevations = perception::MaskingPicture::Elevations;
using perception::Image;
using perception::MaskingPicture;
using vdtree::Mesh;
using vdtree::NodeId;

constexpr int side = 256;
constexpr std::size_t grid_side = 32; // cells of 8 pixels

using Plane = std::vector<double>;

struct Level {
    int width, height;
    Plane values;
    double at(int x, int y) const {
        x = std::clamp(x, 0, width - 1), y = std::clamp(y, 0, height - 1);
        return values[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
    }
};

double tap(const JudgeTables& tables, int distance) {
    distance = std::abs(distance);
    return distance > 2 ? 0 : static_cast<double>(tables.kernel[static_cast<std::size_t>(distance)]);
}

Level reduced(const Level& fine, const JudgeTables& tables) {
    Level coarse{(fine.width + 1) / 2, (fine.height + 1) / 2, {}};
    for (int y = 0; y < coarse.height; ++y)
        for (int x = 0; x < coarse.width; ++x) {
            double sum = 0;
            for (int dy = -2; dy <= 2; ++dy)
                for (int dx = -2; dx <= 2; ++dx)
                    sum += tap(tables, dx) * tap(tables, dy) * fine.at(2 * x + dx, 2 * y + dy);
            coarse.values.push_back(sum);
        }
    return coarse;
}

Level expanded(const Level& coarse, const Level& like, const JudgeTables& tables) {
    Level fine{like.width, like.height, {}};
    for (int y = 0; y < fine.height; ++y)
        for (int x = 0; x < fine.width; ++x) {
            double sum = 0;
            for (int cy = y / 2 - 2; cy <= y / 2 + 2; ++cy)
                for (int cx = x / 2 - 2; cx <= x / 2 + 2; ++cx)
                    sum += 4 * tap(tables, x - 2 * cx) * tap(tables, y - 2 * cy) * coarse.at(cx, cy);
            fine.values.push_back(sum);
        }
    return fine;
}

// Sensitivity and weights at a luminance: log-linear between the nodes, which stand at powers of two and in between.
JudgeTables::Node node_at(const JudgeTables& tables, const JudgeTables::Band& band, double luminance) {
    const double per_octave = std::exp2(23 - tables.luminance_shift), octave = std::floor(std::log2(luminance));
    const double place = (octave + 127 + luminance / std::exp2(octave) - 1) * per_octave - tables.first_luminance;
    const double clamped = std::clamp(place, 0.0, static_cast<double>(tables.luminances - 1));
    const auto below = std::min(static_cast<std::size_t>(clamped), static_cast<std::size_t>(tables.luminances) - 2);
    const auto share = static_cast<float>(clamped - static_cast<double>(below));
    const JudgeTables::Node &a = band.nodes[below], &b = band.nodes[below + 1];
    return {std::lerp(a.log2_s, b.log2_s, share), std::lerp(a.own, b.own, share),
            std::lerp(a.smoothed, b.smoothed, share)};
}

Plane pooled_maskers(const JudgeTables& tables, std::size_t band, const Level& fine, const Level& around) {
    const auto luminance = [&](int x, int y) {
        return std::max(around.at(x, y), static_cast<double>(tables.floor_cdm2));
    };
    const auto contrast = [&](int x, int y) { return (fine.at(x, y) - around.at(x, y)) / luminance(x, y); };
    Level maskers{fine.width, fine.height, {}};
    for (int y = 0; y < fine.height; ++y)
        for (int x = 0; x < fine.width; ++x) {
            double smoothed = 0;
            for (int dy = -1; dy <= 1; ++dy)
                for (int dx = -1; dx <= 1; ++dx)
                    smoothed += (2 - std::abs(dx)) * (2 - std::abs(dy)) / 16.0 * contrast(x + dx, y + dy);
            const JudgeTables::Node node = node_at(tables, tables.bands[band], luminance(x, y));
            maskers.values.push_back(std::abs(static_cast<double>(node.own) * contrast(x, y) +
                                              static_cast<double>(node.smoothed) * smoothed) *
                                     std::exp2(static_cast<double>(node.log2_s)) *
                                     static_cast<double>(tables.bands[band].of_patch));
        }
    Plane pooled;
    for (int y = 0; y < fine.height; ++y)
        for (int x = 0; x < fine.width; ++x) {
            double sum = 0, weights = 0;
            for (int dy = -4; dy <= 4; ++dy)
                for (int dx = -4; dx <= 4; ++dx) {
                    const double weight = std::exp(-(dx * dx + dy * dy) / (2 * 1.5 * 1.5));
                    sum += weight * maskers.at(x + dx, y + dy), weights += weight;
                }
            pooled.push_back(sum / weights);
        }
    return pooled;
}

Image bars(double period_px, double contrast, int from_column = 0) {
    Image image{side, side, 1, {}};
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x)
            image.values.push_back(static_cast<float>(
                20 * (1 + (x < from_column ? 0 : contrast * std::cos(2 * std::numbers::pi * x / period_px)))));
    return image;
}

class MaskingTest : public render::testing::GlTest {
protected:
    static JudgeTables tables() { return *perception::judge_tables(side, side, 0.5F, 100, {}); }

    render::ElevationGrid elevations_of(const Image& image, int cell_px = 8) {
        auto judge = GpuJudge::create(context(), image, {});
        EXPECT_TRUE(judge) << judge.error().message;
        EXPECT_TRUE(judge->passes().map_elevations(cell_px));
        return *judge->passes().read_elevations();
    }
    static double at(const render::ElevationGrid& grid, std::size_t band, std::size_t column, std::size_t row) {
        const auto columns = static_cast<std::size_t>(grid.columns), rows = static_cast<std::size_t>(grid.rows);
        return static_cast<double>(grid.elevation[(band * rows + row) * columns + column]);
    }
};

TEST_F(MaskingTest, NothingMasksInAFlatPicture) { EXPECT_THAT(elevations_of(bars(8, 0)).elevation, Each(1.0F)); }

TEST_F(MaskingTest, ElevationsAreTheLeastOfWhatTheTablesSay) {
    Image image = bars(9.3, 0.3);
    std::mt19937_64 random(3);
    for (float& v : image.values) v *= static_cast<float>(shapes::random_between(random, 0.8, 1.2));
    const render::ElevationGrid grid = elevations_of(image);
    const auto [least, most] = std::ranges::minmax(image.values);
    const JudgeTables t = *perception::judge_tables(side, side, least, most, {});
    Level fine{side, side, Plane(image.values.begin(), image.values.end())};
    for (std::size_t band = 0; band < 3; ++band) {
        const Level next = reduced(fine, t);
        const Plane pooled = pooled_maskers(t, band, fine, expanded(next, fine, t));
        for (std::size_t row = 8; row < grid_side - 8; ++row)
            for (std::size_t column = 8; column < grid_side - 8; ++column) {
                double masker = 1e30;
                const int first_x = static_cast<int>(8 * column) >> band,
                          last_x = static_cast<int>(8 * column + 7) >> band,
                          first_y = static_cast<int>(8 * row) >> band, last_y = static_cast<int>(8 * row + 7) >> band;
                for (int y = first_y - 1; y <= last_y + 2; ++y)
                    for (int x = first_x - 1; x <= last_x + 2; ++x)
                        masker =
                            std::min(masker, pooled[static_cast<std::size_t>(y) * static_cast<std::size_t>(fine.width) +
                                                    static_cast<std::size_t>(x)]);
                const double elevation = std::pow(1 + std::pow(masker, static_cast<double>(t.masking_power)),
                                                  1 / static_cast<double>(t.masking_knee));
                ASSERT_NEAR(at(grid, band, column, row), elevation, 1e-3 * elevation)
                    << "band " << band << ", cell " << column << " " << row;
            }
        fine = next;
    }
}

TEST_F(MaskingTest, BarsMaskWhereTheyAreAtTheirOwnFrequency) {
    const double ppd = 2 * tables().bands[0].nominal_cpd;
    for (const std::size_t own : {std::size_t{1}, std::size_t{2}}) {
        const double period = ppd / tables().bands[own].nominal_cpd;
        const render::ElevationGrid weak = elevations_of(bars(period, 0.1, side / 2)),
                                    strong = elevations_of(bars(period, 0.6, side / 2));
        const std::size_t row = grid_side / 2, among = 3 * grid_side / 4;
        EXPECT_GT(at(weak, own, among, row), 2);
        EXPECT_GT(at(strong, own, among, row), 1.5 * at(weak, own, among, row));
        EXPECT_GT(at(strong, own, among, row), at(strong, own + 2, among, row));
        EXPECT_LT(at(strong, own, 2, row), 1.001); // far from them
    }
}

TEST_F(MaskingTest, RefusesCellsThatAreNone) {
    auto judge = GpuJudge::create(context(), bars(8, 0.5), {});
    for (const int cell : {0, -3, 65})
        EXPECT_THAT(error_in(judge->passes().map_elevations(cell)), HasSubstr("1 to 64 pixels"));
    EXPECT_FALSE(judge->passes().read_elevations());
}

vdtree::View view_of(int size) {
    vdtree::View view;
    view.eye = {0, 0, 5};
    view.width = view.height = size;
    view.fov_y_degrees = perception::physical_field({}, size).value();
    return view;
}

// The same everywhere, or only in the left half of the window.
MaskingPicture masking(const vdtree::View& view, std::vector<float> by_band, bool is_half = false) {
    Elevations e{8, (view.width + 7) / 8, (view.height + 7) / 8, {}, {}};
    for (std::size_t i = 0; i < by_band.size(); ++i) {
        e.bands.emplace_back(16 / std::exp2(i));
        for (int row = 0; row < e.rows; ++row)
            for (int column = 0; column < e.columns; ++column)
                e.elevation.push_back(is_half && column >= e.columns / 2 ? 1 : by_band[i]);
    }
    return *MaskingPicture::create(view, {&e, 1});
}

class MaskedErrorTest : public testing::Test {
protected:
    std::vector<float> costs(const vdtree::DistanceCriterion& criterion) const {
        return *vdtree::find_every_cost(tree, criterion, perception::viewpoint_of(tree, view, options));
    }
    vdtree::DistanceCriterion unmasked() const { return *perception::error_distances(tree, view, options); }
    vdtree::DistanceCriterion masked(const MaskingPicture& by) const {
        auto made = perception::masked_error_distances(tree, {}, by, view, options);
        EXPECT_TRUE(made) << made.error().message;
        return std::move(*made);
    }

    static const vdtree::VertexTree& measured_ball() {
        static const vdtree::VertexTree ball = support::measured(support::built(shapes::bumpy_sphere(5, 0.02)));
        return ball;
    }
    vdtree::VertexTree tree = measured_ball().share();
    vdtree::View view = view_of(512);
    perception::FoldTestOptions options;
};

TEST_F(MaskedErrorTest, CostsNoMoreThanUnmaskedAndNoLessTowardsTheRoot) {
    for (const bool has_gaze : {false, true}) {
        if (has_gaze) options.gaze_px = glm::dvec2(400, 60);
        const std::vector<float> without = costs(unmasked());
        EXPECT_EQ(costs(masked(masking(view, {1, 1, 1, 1}))), without);
        for (const auto& way : {std::vector<float>{1, 4, 4, 1, 1}, {2, 2, 2, 2, 2, 2, 2}, {1, 1, 1, 8}}) {
            for (const bool is_half : {false, true}) {
                const vdtree::DistanceCriterion criterion = masked(masking(view, way, is_half));
                EXPECT_TRUE(criterion.is_monotone());
                const std::vector<float> with = costs(criterion);
                std::size_t less = 0;
                for (std::size_t i = 0; i < with.size(); ++i) {
                    ASSERT_LE(with[i], without[i]) << "node " << i;
                    less += with[i] < without[i];
                }
                EXPECT_GT(less, way.front() == 1 ? 0 : is_half ? with.size() / 10 : with.size() / 4);
            }
        }
    }
}

// Raised everywhere and at all frequencies, thresholds are those of an observer who sees so much less.
TEST_F(MaskedErrorTest, IsThatOfALessSensitiveObserver) {
    const std::vector<float> with = costs(masked(masking(view, std::vector<float>(9, 4.0F))));
    perception::Person person = perception::default_person;
    person.gain /= 4;
    options.csf = perception::csf_of(person);
    const std::vector<float> less = costs(unmasked());
    std::size_t alike = 0;
    for (std::size_t i = 0; i < with.size(); ++i) alike += std::abs(with[i] - less[i]) <= 0.02F * less[i];
    EXPECT_GT(alike, with.size() * 9 / 10);
}

TEST_F(MaskedErrorTest, RefusesWhatIsNoMasking) {
    Elevations e{8, 64, 64, {perception::CyclesPerDegree(16)}, std::vector<float>(64 * 64, 1)};
    ASSERT_TRUE(MaskingPicture::create(view, {&e, 1}));
    const auto refused = [&](auto&& spoil, const char* why) {
        Elevations spoilt = e;
        spoil(spoilt);
        EXPECT_THAT(error_in(MaskingPicture::create(view, {&spoilt, 1})), HasSubstr(why)) << why;
    };
    refused([](auto& s) { s.elevation[7] = 0.5F; }, "elevation 7 must be 1 or more");
    refused([](auto& s) { s.elevation[7] = std::nanf(""); }, "elevation 7 must be 1 or more");
    refused([](auto& s) { s.elevation.pop_back(); }, "not as many elevations");
    refused([](auto& s) { s.columns = 63; }, "do not cover");
    refused([](auto& s) { s.cell_px = 0; }, "there are no cells");
    refused([](auto& s) { s.bands.clear(); }, "1 to 16 bands");
    EXPECT_FALSE(MaskingPicture::create(view, {}));
    EXPECT_THAT(error_in(perception::masked_error_distances(tree, {}, masking(view_of(256), {2}), view, options)),
                HasSubstr("another window"));
}

// Upright bars across the view, so many a unit of length, half of it open.
Mesh grate(double bars_per_unit, double z) {
    Mesh mesh;
    for (double x = -1.6; x < 1.6; x += 1 / bars_per_unit)
        mesh = shapes::together(mesh, shapes::placed(shapes::cube(1), 1 / (4 * bars_per_unit), {x, 0, z}));
    for (glm::dvec3& p : mesh.positions) p.y = p.y > 0 ? 1.6 : -1.6;
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) mesh.colours.push_back({0.02F, 0.02F, 0.02F, 1});
    return mesh;
}

// A ball as rough as sandpaper: what its folds change is fine.
Mesh rough_ball() {
    Mesh mesh = shapes::icosphere(6);
    std::mt19937_64 random(11);
    for (glm::dvec3& p : mesh.positions) p *= shapes::random_between(random, 0.998, 1.002);
    return mesh;
}

class MaskedSceneTest : public render::testing::GlTest {
protected:
    static Session session_of(std::optional<Mesh> around) {
        static const vdtree::VertexTree ball = support::measured(support::built(rough_ball()), 0);
        Scene scene = Scene::of(ball.share());
        if (around) scene.backdrop.push_back({support::built(*around, {.prelit = true})});
        return *Session::create(std::move(scene));
    }
    static vdtree::View view() {
        vdtree::View window = view_of(side);
        window.eye = {0, 0, 18};
        return window;
    }
    Image picture(const Session& session, const vdtree::Cut& cut) {
        auto renderer = session::SceneRenderer::create(context(), session);
        render::DrawOptions options;
        options.samples = 16;
        options.background = session.background();
        const session::DrawnCut drawn[] = {{&cut}};
        const auto frame = renderer->draw(drawn, view(), options);
        EXPECT_TRUE(frame) << frame.error().message;
        return luminance_image(*frame, {});
    }
    struct Kept {
        double triangles, v;
    };
    Kept kept(std::optional<Mesh> around, const AsSeenOptions& options) {
        Session session = session_of(std::move(around));
        const auto made = simplify_as_seen(session, context(), view(), {.purpose = Purpose::picture}, options);
        EXPECT_TRUE(made) << made.error().message;
        vdtree::Cut whole(session.tree());
        whole.unfold_all();
        const auto judged = perception::judge_modern(picture(session, whole), picture(session, made->cuts[0]), {});
        EXPECT_EQ(judged->visible_pixels, 0u) << judged->max_ratio;
        return {static_cast<double>(made->stats.triangles), judged->max_ratio};
    }
    static constexpr AsSeenOptions unmasked = {.folds_hidden = false},
                                   masked = {.folds_hidden = false, .masking = Masking::scene};
};

TEST_F(MaskedSceneTest, BarsBeforeAModelMaskItTheFinerTheyAre) {
    const double open = kept(grate(1, 1.5), unmasked).triangles;
    double last = open;
    for (const double bars_per_unit : {1.0, 5.0, 12.0}) { // 0.3 to 3.5 cpd
        const double with = kept(grate(bars_per_unit, 1.5), masked).triangles;
        EXPECT_LE(with, 1.0001 * last)
            << bars_per_unit; // what is beside flatter parts folds farther outside the window
        last = with;
    }
    EXPECT_LT(last, 0.9 * open);
}

TEST_F(MaskedSceneTest, WhatStandsBehindAModelMasksNothingOfIt) {
    const double without = kept(grate(12, -2.5), unmasked).triangles;
    EXPECT_GT(kept(grate(12, -2.5), masked).triangles, 0.98 * without);
}

TEST_F(MaskedSceneTest, WhatIsBehindBarsFolds) {
    const double open = kept(grate(1, 1.5), unmasked).triangles;
    EXPECT_LT(kept(grate(1, 1.5), {.folds_hidden = true}).triangles, 0.8 * open);
}

TEST_F(MaskedSceneTest, DoesNotCountForGazesThatAreUnsure) {
    Session session = session_of(grate(12, 1.5));
    session.set_gaze(Gaze{{20, 20}, 1});
    const auto made = require(simplify_as_seen(session, context(), view(), {.purpose = Purpose::picture}, masked));
    const auto effect = std::ranges::find(made->passes, "masking", &Effect::name);
    ASSERT_NE(effect, made->passes.end());
    EXPECT_FALSE(effect->on);
    EXPECT_THAT(effect->why, HasSubstr("not known for sure"));
    EXPECT_EQ(made->stats.triangles,
              simplify_as_seen(session, context(), view(), {.purpose = Purpose::picture}, unmasked)->stats.triangles);
}

class PassesTest : public MaskedSceneTest {
protected:
    // A second ball far behind, if wanted, and what stands around; lit by a sun, which casts shadows or none.
    static Session session_of(bool has_second, std::optional<Mesh> around, std::optional<bool> casts = {}) {
        static const vdtree::VertexTree ball =
            *measured_under_lights(support::measured(support::built(shapes::bumpy_sphere(4, 0.01)))); // once for all
        Scene scene = Scene::of(ball.share());
        if (has_second) scene.objects.push_back({ball.share(), {.translation = {1, 0, -60}}, "far"});
        if (around) scene.backdrop.push_back({support::built(*around, {.prelit = !casts.has_value()})});
        if (casts) {
            vdtree::LightSource sun;
            sun.direction = glm::normalize(glm::dvec3(0.3, 0.5, 1));
            sun.intensity = 0.7;
            sun.casts_shadow = *casts;
            scene.lights = *calibration::LightRig::of({.lights = {sun}, .ambient = 0.2}, "a sun");
        }
        return *Session::create(std::move(scene));
    }
    std::vector<Effect> passes(Session& session, AsSeenOptions options = {.masking = Masking::scene}) {
        options.samples = 4;
        const auto made = simplify_as_seen(session, context(), view(), {.purpose = Purpose::picture}, options);
        EXPECT_TRUE(made) << made.error().message;
        for (const Effect& effect : made->passes) {
            EXPECT_FALSE(effect.why.empty()) << effect.name;
            const bool was_drawn = effect.surface_passes > 0;
            EXPECT_EQ(was_drawn, effect.texture_bytes > 0) << effect.name;
            EXPECT_EQ(was_drawn, effect.milliseconds > 0) << effect.name;
        }
        return made->passes;
    }
    static const Effect& of(const std::vector<Effect>& passes, const char* name) {
        return *std::ranges::find(passes, name, &Effect::name);
    }
    static constexpr std::uint64_t pixels = side * side;
};

TEST_F(PassesTest, OfOneObjectAloneAreThoseOfItsDepths) {
    Session session = session_of(false, std::nullopt);
    const auto all = passes(session);
    EXPECT_TRUE(of(all, "occlusion").on);
    EXPECT_EQ(of(all, "occlusion").surface_passes, 4);
    EXPECT_EQ(of(all, "occlusion").texture_bytes, 4 * pixels);
    for (const char* off : {"layers", "masking", "shadows"}) {
        EXPECT_FALSE(of(all, off).on) << off;
        EXPECT_EQ(of(all, off).surface_passes + of(all, off).full_screen_passes, 0) << off;
    }
    EXPECT_THAT(of(all, "masking").why, HasSubstr("nothing around"));
}

TEST_F(PassesTest, AreNoneWhereNothingIsAskedFor) {
    Session session = session_of(true, grate(12, 1.5), true);
    EXPECT_THAT(passes(session, {.folds_hidden = false}), ::testing::IsEmpty());
}

TEST_F(PassesTest, OfMaskingAreTwoPicturesALayerLess) {
    for (const bool has_second : {false, true}) { // one layer, and two
        Session session = session_of(has_second, grate(12, 1.5));
        const auto all = passes(session);
        EXPECT_EQ(of(all, "layers").on, has_second);
        EXPECT_TRUE(of(all, "masking").on);
        EXPECT_EQ(of(all, "masking").surface_passes, has_second ? 12 : 8);
        EXPECT_GT(of(all, "masking").full_screen_passes, 10);
        EXPECT_FALSE(of(all, "shadows").on);
    }
}

TEST_F(PassesTest, GoByTheGazeWithTheSamePictures) {
    Session session = session_of(false, grate(12, 1.5));
    const int without = of(passes(session), "masking").full_screen_passes;
    session.set_gaze(Gaze{{20, 20}, 0});
    EXPECT_EQ(of(passes(session), "masking").full_screen_passes, without);
    session.set_gaze(Gaze{{20, 20}, 2});
    EXPECT_THAT(of(passes(session), "masking").why, HasSubstr("not known for sure"));
    EXPECT_EQ(of(passes(session), "masking").surface_passes, 0);
}

TEST_F(PassesTest, MaskNothingOfWhatMovesOverTheRetina) {
    Session session = session_of(false, grate(12, 1.5));
    session.set_velocity(perception::DegreesPerSecond(5));
    const auto all = passes(session);
    EXPECT_FALSE(of(all, "masking").on);
    EXPECT_EQ(of(all, "masking").surface_passes, 0);
    EXPECT_THAT(of(all, "masking").why, HasSubstr("over the retina"));
}

TEST_F(PassesTest, OfShadowsAreThereWhereALightCastsSome) {
    Session dark = session_of(false, grate(12, 1.5), false), cast = session_of(false, grate(12, 1.5), true);
    const auto without = passes(dark), with = passes(cast);
    EXPECT_FALSE(of(without, "shadows").on);
    EXPECT_EQ(of(without, "shadows").texture_bytes, 0u);
    EXPECT_TRUE(of(with, "shadows").on);
    EXPECT_EQ(of(with, "shadows").surface_passes, 1);
    EXPECT_GT(of(with, "shadows").texture_bytes, 0u);
}

TEST_F(PassesTest, AllOfThemWhereAllIsCalledFor) {
    Session session = session_of(true, grate(12, 1.5), true);
    for (const Effect& effect : passes(session)) EXPECT_TRUE(effect.on) << effect.name << ": " << effect.why;
}

TEST_F(PassesTest, AreDrawnOnceForACameraThatStandsStill) {
    Session session = session_of(true, grate(12, 1.5), true);
    const auto made = session.simplify(view(), {.purpose = Purpose::picture});
    auto renderer = SceneRenderer::create(context(), session);
    render::DrawOptions options;
    options.samples = 1;
    for (int frame = 0; frame < 3; ++frame) ASSERT_TRUE(renderer->draw(drawn_cuts(made->cuts), view(), options));
    EXPECT_EQ(renderer->shadows()->redraws, 1u);
    Follower follower(session);
    ASSERT_TRUE(follower.follow(view(), {.purpose = Purpose::picture}));
    EXPECT_EQ(follower.follow(view(), {.purpose = Purpose::picture})->stats.node_tests, 0u);
}

TEST_F(PassesTest, MaskingThatIsNotWorthItLeavesTheFoldTestAlone) {
    Session session = session_of(false, shapes::placed(shapes::cube(4), 30, {0, 0, -50})); // an even wall far behind
    const auto all = passes(session);
    EXPECT_FALSE(of(all, "masking").on);
    EXPECT_GT(of(all, "masking").surface_passes, 0); // to find that out
    EXPECT_THAT(of(all, "masking").why, HasSubstr("too little"));
}

} // namespace unseen::session::masking_test
