// Stages in which a whole mesh folds, and their pictures: the pyramid against gratings and sums that are known, stages
// against surfaces that show nothing, and against the background alone.
#include "measure/fold_record.h"

#include "fold/fold_errors.h"
#include "measure/pyramid.h"
#include "measure/stage_picture.h"
#include "measured.h"
#include "shapes.h"
#include "sound.h"
#include "testing.h"

namespace unseen::perception {

using namespace vdtree;

namespace fold_stages_test {

// Colours are what is drawn.
VertexTree built(const Mesh& mesh, int threads = 1) {
    return support::measured(support::built(mesh, {.prelit = true, .threads = 1}), threads);
}

std::span<const FoldStage> stages_of(const VertexTree& tree) { return tree.attribute<FoldStage>(stages_name); }
std::vector<FoldError> errors_of(const VertexTree& tree) { return fold_errors_of(support::sound(tree))->of_nodes; }

Mesh grey(Mesh mesh, float luminance) {
    mesh.colours.assign(mesh.positions.size(), {luminance, luminance, luminance, 1});
    return mesh;
}

std::size_t background(float luminance) {
    const auto& all = FoldStage::backgrounds;
    return static_cast<std::size_t>(std::find(all.begin(), all.end(), luminance) - all.begin());
}

float largest(const FoldStage& stage, std::size_t background) {
    float most = 0;
    for (const auto& band : stage.contrast[background])
        for (const float contrast : band) most = std::max(most, contrast);
    return most;
}

double sum(const Raster& plane) {
    double all = 0;
    for (const float value : plane.values) all += static_cast<double>(value);
    return all;
}

// Of one stage, with another contrast for each share of ambient light and each background.
LitStages numbered() {
    LitStages stages;
    for (std::size_t share = 0; share < LitStages::ambient_shares.size(); ++share) {
        FoldStage& stage = stages.by_share.emplace_back();
        for (std::size_t k = 0; k < FoldStage::backgrounds.size(); ++k)
            stage.contrast[k][3][1] = 0.01f * static_cast<float>(share + 1) + 0.1f * static_cast<float>(k + 1);
    }
    return stages;
}
float found(const std::vector<FoldStage>& stages, float of_background) {
    return stages.at(0).contrast[background(of_background)][3][1];
}

TEST(LitStages, AreThoseOfTheSharesAndBackgroundsAround) {
    const LitStages all = numbered();
    ASSERT_EQ(all.stage_count(), 1u);
    // A fifth is ambient, as in one of the tables. Before black nothing lies around black but itself; white is a
    // quarter of the brightest of the pictures, between 0.2 and 0.3 of it.
    const auto fifth = all.under({.ambient = 0.2f, .least = 0.8f, .most = 0.8f});
    EXPECT_FLOAT_EQ(found(fifth, 0), 0.03f + 0.1f);
    EXPECT_FLOAT_EQ(found(fifth, 1), 0.03f + 0.7f);
    // More of it: between two tables.
    EXPECT_FLOAT_EQ(found(all.under({.ambient = 0.3f, .least = 0.7f, .most = 0.7f}), 0), 0.04f + 0.1f);
    // Lights that are uneven over the mesh: all that occurs.
    EXPECT_FLOAT_EQ(found(all.under({.ambient = 0.2f, .least = 0, .most = 0.8f}), 0), 0.05f + 0.1f);
    // Half as bright: white is half of the brightest of the pictures.
    EXPECT_FLOAT_EQ(found(all.under({.ambient = 0.1f, .least = 0.4f, .most = 0.4f}), 1), 0.03f + 0.8f);
}

TEST(LitStages, BeforeWhatIsBrighterThanInThePicturesCountForMore) {
    // White has an eighth: twice the brightest of the pictures. |l - 2 c| <= 2 |l - c| + |l|.
    const auto dim = numbered().under({.ambient = 0.025f, .least = 0.1f, .most = 0.1f});
    EXPECT_FLOAT_EQ(found(dim, 1), 2 * (0.03f + 0.9f) + (0.03f + 0.1f));
}

TEST(LitStages, AreNoneWhereThereIsNoLight) {
    EXPECT_TRUE(numbered().under({}).empty());
    EXPECT_TRUE(numbered().under({.ambient = 0, .least = 0, .most = 1}).empty());
    EXPECT_TRUE(LitStages().under({.ambient = 0.2f, .least = 1, .most = 1}).empty());
}

// Every sample's weight in the next level is a quarter, also at the border, where that reaches farther out.
TEST(Pyramid, KeepsLight) {
    for (const std::size_t side : {5u, 8u, 31u, 128u}) {
        Raster plane(side);
        for (std::size_t i = 0; i < plane.values.size(); ++i) plane.values[i] = static_cast<float>((i * 7919) % 101);
        EXPECT_NEAR(4 * sum(reduce(plane)) / sum(plane), 1, 1e-5) << side;
    }
}

TEST(Pyramid, BandsHaveTheirGainAtTheirFrequency) {
    constexpr std::size_t side = 512;
    for (const std::size_t level : {1u, 2u, 3u}) {
        Raster plane(side);
        const double omega = 2 * std::numbers::pi * nominal_frequency(level);
        for (std::size_t y = 0; y < side; ++y)
            for (std::size_t x = 0; x < side; ++x)
                plane.row(y)[x] = static_cast<float>(std::sin(omega * static_cast<double>(x)));
        for (std::size_t i = 0; i < level; ++i) plane = reduce(plane);
        const Raster mean = expand(reduce(plane), plane.side);
        float amplitude = 0;
        const std::size_t middle = plane.side / 2;
        for (std::size_t y = middle - 2; y < middle + 2; ++y)
            for (std::size_t x = middle - 20; x < middle + 20; ++x)
                amplitude = std::max(amplitude, std::abs(plane.row(y)[x] - mean.row(y)[x]));
        EXPECT_NEAR(static_cast<double>(amplitude) / band_gain(level), 1, 0.1)
            << level; // some of the expanded mean is an image of the grating
    }
}

// What sensitivities far away count on: of the mean over the area that a band looks at, a disc as wide as the mesh
// makes up no more than under a Gaussian.
TEST(Pyramid, MeansAreThoseUnderAGaussian) {
    constexpr std::size_t side = 128;
    constexpr double margin = 1.05, radius = side / (2 * margin);
    Raster plane(side);
    for (std::size_t y = 0; y < side; ++y)
        for (std::size_t x = 0; x < side; ++x)
            plane.row(y)[x] = std::hypot(static_cast<double>(x) - side / 2.0 + 0.5,
                                         static_cast<double>(y) - side / 2.0 + 0.5) < radius
                                  ? 1.0f
                                  : 0.0f;
    for (std::size_t band = 0; band < FoldStage::band_count; ++band) {
        const Raster next = reduce(plane);
        const Raster mean = expand(next, plane.side);
        const double most = static_cast<double>(*std::max_element(mean.values.begin(), mean.values.end()));
        const double frequency = FoldStage::frequency(band), gaussian = 1 - std::exp(-frequency * frequency);
        EXPECT_LT(most, 1.1 * gaussian) << band;
        if (band >= 5) EXPECT_GT(most, 0.5 * gaussian) << band;
        plane = next;
    }
}

TEST(FoldStages, GoFromFineToTheRoot) {
    const VertexTree tree = built(shapes::torus(48, 24));
    const auto errors = errors_of(tree);
    ASSERT_FALSE(stages_of(tree).empty());
    for (NodeId node = 1; node < tree.interior_count(); ++node)
        EXPECT_LE(errors[node].stage, errors[support::sound(tree).parents()[node]].stage);
    EXPECT_EQ(errors[VertexTree::root()].stage + 1u, stages_of(tree).size());
    EXPECT_EQ(errors[tree.interior_count() - 1].stage < stages_of(tree).size(), true);
    // Coarse stages show more.
    const std::size_t dark = background(0);
    EXPECT_LT(largest(stages_of(tree).front(), dark), largest(stages_of(tree).back(), dark));
}

// An outline that moves by a hundredth of a cell changes the light of its cells by about that: no single sample that it
// passes counts as a whole cell.
TEST(FoldStages, ShowSmallMovesOfOutlinesAsSmall) {
    const VertexTree tree = built(grey(shapes::bumpy_sphere(5, 0), 0.1f));
    EXPECT_LT(largest(stages_of(tree).front(), background(1)), 0.5f); // with one sample a cell: 2.7
    EXPECT_GT(largest(stages_of(tree).front(), background(1)), 0);
}

// What cannot be told from its background, nor from what is left of it, shows nothing in any stage.
TEST(FoldStages, OfWhatLooksLikeItsBackgroundShowNothing) {
    const VertexTree tree = built(grey(shapes::torus(32, 16), 0.2f));
    for (const FoldStage& stage : stages_of(tree)) EXPECT_LT(largest(stage, background(0.2f)), 1e-3f);
    EXPECT_GT(largest(stages_of(tree).back(), background(0.5f)), 0.1f);
}

// When the last stage has folded, the background is where the mesh was: over areas far wider than the mesh, the
// contrast is its own light over that of the area's background.
TEST(FoldStages, EndInTheBackground) {
    constexpr float luminance = 0.8f, behind = 0.2f;
    const VertexTree tree = built(grey(shapes::torus(32, 16), luminance));
    const auto& last = stages_of(tree).back().contrast[background(behind)];
    const auto over_masks = [&](std::size_t band) {
        return *std::max_element(std::begin(last[band]), std::end(last[band]));
    };
    constexpr std::size_t coarsest = FoldStage::band_count - 1;
    // Half the frequency: four times the area.
    EXPECT_NEAR(over_masks(coarsest - 1) / over_masks(coarsest), 4, 0.5);
    EXPECT_GT(over_masks(3), (luminance - behind) / luminance / 2);
}

TEST(FoldStages, DoNotDependOnTheThreads) {
    const Mesh mesh = shapes::bumpy_sphere(4, 0.02);
    const VertexTree one = built(mesh, 1), four = built(mesh, 4);
    EXPECT_TRUE(std::ranges::equal(stages_of(one), stages_of(four)));
    EXPECT_TRUE(std::ranges::equal(errors_of(one), errors_of(four)));
}

TEST(FoldStages, OfTranslucentVerticesAreNone) {
    Mesh mesh = grey(shapes::torus(16, 8), 0.5f);
    mesh.colours[3].a = 0.5f;
    EXPECT_TRUE(stages_of(built(mesh)).empty());
}

// Pages on one edge.
Mesh pages(int count) {
    Mesh mesh;
    mesh.positions = {{0, 0, -1}, {0, 0, 1}};
    for (int i = 0; i < count; ++i) {
        const double u = 2 * std::numbers::pi * i / count;
        mesh.positions.emplace_back(std::cos(u), std::sin(u), 0.3 * std::sin(7 * u));
        mesh.triangles.push_back({0, 1, static_cast<Index>(2 + i)});
    }
    return mesh;
}

// One triangle several times, each with vertices of its own.
Mesh repeated(int count) {
    Mesh mesh;
    for (int i = 0; i < count; ++i) {
        const auto first = static_cast<Index>(mesh.positions.size());
        mesh.positions.insert(mesh.positions.end(), {{0, 0, 0}, {1, 0, 0}, {0, 1, 0.5}});
        mesh.triangles.push_back({first, first + 1, first + 2});
    }
    return mesh;
}

// Triangles through each other, in a ball.
Mesh crossing(int count) {
    Mesh mesh;
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 3 * count; ++i)
        mesh.positions.push_back(glm::normalize(glm::dvec3(normal(random), normal(random), normal(random))));
    for (Index i = 0; i < static_cast<Index>(count); ++i) mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    return mesh;
}

// Times that a picture's samples are drawn on average, and the picture.
struct Drawn {
    double layers;
    StagePicture picture;
};
Drawn draw(const VertexTree& tree, std::span<const Triangle> triangles, std::size_t direction) {
    const StageCamera camera = stage_camera(tree.bounding_sphere(), direction);
    const TexturedLight untextured;
    StageSurfaces surfaces;
    StagePainter painter(tree, {&untextured, 1}, camera, surfaces);
    auto pictures =
        painter.draw<1>(triangles, [&](WedgeId wedge) { return std::array<float, 1>{tree.luminance()[wedge]}; });
    return {static_cast<double>(painter.drawn()) / (stage_samples * stage_samples), std::move(pictures[0])};
}

double largest_difference(const Raster& a, const Raster& b) {
    double largest = 0;
    for (std::size_t i = 0; i < a.values.size(); ++i)
        largest = std::max(largest, static_cast<double>(std::abs(a.values[i] - b.values[i])));
    return largest;
}

// Every picture shows the same in whichever order its triangles are drawn, and most of what is hidden is not drawn.
TEST(StagePictures, DrawLittleOfWhatIsHidden) {
    constexpr int count = 600;
    for (const auto& [name, mesh, layers_at_most] : {std::tuple("pages", pages(count), 25.0),
                                                     {"repeated", repeated(count), 8.0},
                                                     {"crossing", crossing(count), 15.0}}) {
        const VertexTree tree = support::built(mesh, {.prelit = true, .threads = 1});
        std::vector<Triangle> triangles(support::sound(tree).triangles().begin(),
                                        support::sound(tree).triangles().end());
        for (Triangle& t : triangles)
            for (Index& corner : t) corner = tree.wedge_of_leaf(corner);
        for (const std::size_t direction : {0, 5, 12, 20}) {
            const Drawn drawn = draw(tree, triangles, direction);
            EXPECT_LT(drawn.layers, layers_at_most) << name << ", direction " << direction;
            std::vector<Triangle> shuffled = triangles;
            std::shuffle(shuffled.begin(), shuffled.end(), std::mt19937_64(direction));
            const Drawn again = draw(tree, shuffled, direction);
            EXPECT_EQ(largest_difference(drawn.picture.cover, again.picture.cover), 0) << name;
            EXPECT_LT(largest_difference(drawn.picture.light, again.picture.light), 0.1) << name;
            EXPECT_NEAR(sum(drawn.picture.light), sum(again.picture.light), 1e-3 * sum(drawn.picture.light)) << name;
        }
    }
}

// As renderers do, in whichever order the sides are drawn: leaves whose sides have folded onto each other keep them.
TEST(StagePictures, ShowTheSideThatFacesTheEye) {
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0},    {1, 0, 0},
                      {0, 1, 0}, {0, 0, 0}, {1, 0, 0}, {0, -0.01, 0}};
    mesh.colours.assign(9, {0.8f, 0.8f, 0.8f, 1});
    std::fill_n(mesh.colours.begin() + 3, 3, glm::vec4(0.2f, 0.2f, 0.2f, 1));
    mesh.triangles = {{0, 1, 2}, {4, 3, 5}, {6, 7, 8}}; // the last one, so that the surface is open
    const VertexTree tree = support::built(mesh, {.prelit = true, .threads = 1});
    ASSERT_EQ(tree.closedness(), Closedness::open);
    std::vector<Triangle> sides(support::sound(tree).triangles().begin(), support::sound(tree).triangles().end());
    for (Triangle& t : sides)
        for (Index& corner : t) corner = tree.wedge_of_leaf(corner);
    for (const bool is_reversed : {false, true}) {
        if (is_reversed) std::reverse(sides.begin(), sides.end());
        for (const std::size_t direction : {0, 25}) { // from above, from below
            const StagePicture picture = draw(tree, sides, direction).picture;
            EXPECT_NEAR(sum(picture.light) / sum(picture.cover), direction == 0 ? 0.8 : 0.2, 0.01) << is_reversed;
        }
    }
}

} // namespace fold_stages_test
} // namespace unseen::perception
