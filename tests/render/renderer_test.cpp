// What is drawn, against known truth.
//
// Tolerances. Mesa's llvmpipe interpolates in float from coefficients set up per triangle, which costs up to about 1e-6
// of the value; rasterisers snap vertices to 1/256 pixel (GL asks for at least 1/16), which moves edges by up to that.
#include "gl_test.h"
#include "scenes.h"

#include <unseen/render/renderer.h>

#include "built.h"
#include "shapes.h"

namespace renderer_test {

using namespace unseen::render;
using namespace unseen::render::testing;
using unseen::vdtree::Cut;
using unseen::vdtree::Similarity;
using unseen::vdtree::View;

constexpr float value_tolerance = 1e-5f;                 // relative luminance inside of a triangle; see above
constexpr float stored_tolerance = 0.5f / 65535 + 1e-6f; // luminance is stored in 16 bits
constexpr double snapping_px = 1.0 / 256;                // of edges; see above
constexpr double sample_share = 1.0 / 16;                // one of 16 samples a pixel

class RendererTest : public GlTest {
protected:
    Frame draw(const Scene& scene, const View& view, const DrawOptions& options = {},
               const Similarity& placement = {}) {
        return draw(scene.tree, scene.cut, view, options, placement);
    }

    Frame draw(const unseen::vdtree::VertexTree& tree, const Cut& cut, const View& view,
               const DrawOptions& options = {}, const Similarity& placement = {}) {
        auto renderer = Renderer::create(context(), tree);
        if (!renderer) {
            ADD_FAILURE() << renderer.error().message;
            return {};
        }
        auto frame = renderer->draw(cut, view, options, placement);
        if (!frame) {
            ADD_FAILURE() << frame.error().message;
            return {};
        }
        EXPECT_EQ(context().take_errors(), "");
        EXPECT_EQ(frame->luminance.size(), static_cast<std::size_t>(view.width * view.height));
        EXPECT_EQ(frame->colour.size(), 3 * frame->luminance.size());
        return std::move(*frame);
    }
};

float at(const Frame& frame, int column, int row) {
    return frame.luminance[static_cast<std::size_t>(row * frame.width + column)];
}

glm::vec3 colour_at(const Frame& frame, int column, int row) {
    const auto first = 3 * static_cast<std::size_t>(row * frame.width + column);
    return {frame.colour[first], frame.colour[first + 1], frame.colour[first + 2]};
}

struct Difference {
    double largest = 0, mean = 0;
};

Difference difference(const Frame& a, const Frame& b) {
    Difference d;
    EXPECT_EQ(a.luminance.size(), b.luminance.size());
    for (std::size_t i = 0; i < a.luminance.size(); ++i) {
        const double off = std::abs(static_cast<double>(a.luminance[i]) - b.luminance[i]);
        d.largest = std::max(d.largest, off);
        d.mean += off / static_cast<double>(a.luminance.size());
    }
    return d;
}

TEST_F(RendererTest, FillsTheScreenWithTheQuadsLuminance) {
    const Scene scene(rectangle({-9, -9}, {9, 9}, 0, grey(0.5f)));
    for (auto [width, height] : {std::pair{64, 64}, {1, 1}, {97, 13}, {5, 111}}) {
        const Frame frame = draw(scene, frontal_view(width, height));
        ASSERT_EQ(frame.width, width);
        ASSERT_EQ(frame.height, height);
        EXPECT_THAT(frame.luminance, ::testing::Each(::testing::FloatNear(0.5f, stored_tolerance)))
            << width << "x" << height;
        EXPECT_THAT(frame.colour, ::testing::Each(::testing::FloatNear(0.5f, stored_tolerance)))
            << width << "x" << height;
    }
}

TEST_F(RendererTest, KeepsTheBackgroundExact) {
    const Scene scene(rectangle({-0.5, -0.5}, {0.5, 0.5}, 0, grey(0.9f)));
    for (int samples : {1, 3, 7, 16, 256})
        for (float background : {0.0f, 0.19597990f, 1.0f}) {
            DrawOptions options;
            options.samples = samples;
            options.background = background;
            const Frame frame = draw(scene, frontal_view(16, 16), options);
            for (int column = 0; column < 16; ++column) {
                EXPECT_EQ(at(frame, column, 0), background) << samples << " samples";
                EXPECT_EQ(colour_at(frame, column, 15), glm::vec3(background)) << samples << " samples";
            }
            EXPECT_NEAR(at(frame, 8, 8), 0.9, value_tolerance);
        }
}

TEST_F(RendererTest, PutsTheTopLeftFirst) {
    // A mark in the upper left quarter of a window that is wider than high.
    const Scene scene(rectangle({-1.5, 0.5}, {-1, 0.75}, 0, glm::vec4(1, 0.5, 0, 1)));
    DrawOptions options;
    options.background = 0;
    const Frame frame = draw(scene, frontal_view(64, 32), options); // 16 pixels to the unit; x from -2 to 2
    for (int row = 0; row < 32; ++row)
        for (int column = 0; column < 64; ++column) {
            const bool inside = column >= 8 && column < 16 && row >= 4 && row < 8;
            EXPECT_NEAR(at(frame, column, row), inside ? 0.2126 + 0.5 * 0.7152 : 0, value_tolerance)
                << column << ", " << row;
        }
    EXPECT_NEAR(colour_at(frame, 10, 5).r, 1, value_tolerance);
    EXPECT_NEAR(colour_at(frame, 10, 5).g, 0.5, value_tolerance);
    EXPECT_NEAR(colour_at(frame, 10, 5).b, 0, value_tolerance);
}

TEST_F(RendererTest, CoversPixelsByTheirShareOfARectangle) {
    const int n = 16;
    const double lo = -0.53, hi = 0.471; // its edges lie inside of pixels
    const Scene scene(rectangle({lo, lo}, {hi, hi}, 0, grey(1)));
    DrawOptions options;
    options.background = 0;
    const Frame frame = draw(scene, frontal_view(n, n), options);
    const auto overlap = [&](double from, double to) { // in pixels of size 1
        return std::clamp(std::min(to, hi) - std::max(from, lo), 0.0, 2.0) * n / 2;
    };
    for (int row = 0; row < n; ++row)
        for (int column = 0; column < n; ++column) {
            const double across = overlap(-1 + 2.0 * column / n, -1 + 2.0 * (column + 1) / n);
            const double down = overlap(1 - 2.0 * (row + 1) / n, 1 - 2.0 * row / n);
            const double share = across * down;
            const bool corner = share > 0 && across < 1 && down < 1;
            // Rooks divide rows and columns evenly, so straight edges are within one sample; a corner is a discrepancy
            // of two dimensions, for which 16 rooks promise less.
            const double tolerance = (corner ? 3 : 1) * sample_share + snapping_px;
            EXPECT_NEAR(at(frame, column, row), share, tolerance) << column << ", " << row;
        }
}

TEST_F(RendererTest, InterpolatesLuminanceInSpaceNotOnTheScreen) {
    // A floor that runs from the viewer to the distance: y = -1, z from 2 (behind the eye) to -20.
    const auto truth = [](double z) { return 0.9 + 0.04 * (z - 2); };
    Mesh floor;
    const glm::vec4 near = grey(static_cast<float>(truth(2))), far = grey(static_cast<float>(truth(-20)));
    add_quad(floor, {glm::dvec3(-60, -1, 2), glm::dvec3(60, -1, 2), glm::dvec3(60, -1, -20), glm::dvec3(-60, -1, -20)},
             {near, near, far, far});
    const Scene scene(floor);
    DrawOptions options;
    options.samples = 1;
    const int n = 64;
    const Frame frame = draw(scene, frontal_view(n, n), options);
    int seen = 0;
    for (int row = n / 2; row < n; ++row) {
        const double down = (2 * row + 1.0) / n - 1; // of the ray (x, -down, -1) from the eye at z = 1
        const double z = 1 - 1 / down;
        if (z < -19) continue;
        for (int column = 0; column < n; ++column, ++seen)
            EXPECT_NEAR(at(frame, column, row), truth(z), value_tolerance) << column << ", " << row;
    }
    EXPECT_GT(seen, 1000);
}

TEST_F(RendererTest, DrawsTwiceTheSameBitForBit) {
    const Scene scene(bumpy_sphere(40));
    View view = frontal_view(150, 100);
    view.eye = {1, 1, 2};
    for (bool wireframe : {false, true})
        for (Shading shading : {Shading::smooth, Shading::flat}) {
            DrawOptions options;
            options.wireframe = wireframe;
            options.shading = shading;
            auto renderer = require(Renderer::create(context(), scene.tree));
            const auto first = require(renderer->draw(scene.cut, view, options));
            ASSERT_TRUE(renderer->draw(scene.cut, frontal_view(31, 77), {})); // something else in between
            const auto second = require(renderer->draw(scene.cut, view, options));
            EXPECT_EQ(first->luminance, second->luminance);
            EXPECT_EQ(first->colour, second->colour);
            const Frame third = draw(scene, view, options); // by another renderer
            EXPECT_EQ(first->luminance, third.luminance);
        }
}

TEST_F(RendererTest, SeedDecidesTheSamplesAndNothingElse) {
    const Scene scene(bumpy_sphere(40));
    View view = frontal_view(64, 64);
    view.eye = {0, 0, 3};
    DrawOptions one, two;
    two.seed = 2;
    const Difference d = difference(draw(scene, view, one), draw(scene, view, two));
    EXPECT_GT(d.largest, 0);
    EXPECT_LT(d.mean, 0.01);
}

TEST_F(RendererTest, ShowsWhatIsNearer) {
    for (bool near_first : {true, false})
        for (double gap : {1.0, 1e-2, 1e-4}) { // of a distance of 1
            Mesh mesh;
            if (near_first) add_rectangle(mesh, {-9, -9}, {9, 9}, 0, grey(0.25f));
            add_rectangle(mesh, {-9, -9}, {9, 9}, -gap, grey(0.75f));
            if (!near_first) add_rectangle(mesh, {-9, -9}, {9, 9}, 0, grey(0.25f));
            const Scene scene(mesh);
            const Frame front = draw(scene, frontal_view(32, 32));
            EXPECT_THAT(front.luminance, ::testing::Each(::testing::FloatNear(0.25f, value_tolerance))) << gap;
            View from_behind = frontal_view(32, 32);
            from_behind.eye = {0, 0, -2};
            const Frame back = draw(scene, from_behind);
            EXPECT_THAT(back.luminance, ::testing::Each(::testing::FloatNear(0.75f, value_tolerance))) << gap;
        }
}

// Two sides in one place, in either order, of different shapes of triangles; and with a colour of its own for each.
TEST_F(RendererTest, ShowsTheSideThatFacesTheEye) {
    for (const bool front_first : {true, false}) {
        Mesh front = rectangle({-7, -8}, {9, 9}, 0, grey(0.75f)), back = rectangle({-7, -8}, {9, 9}, 0, grey(0.25f));
        for (auto& t : back.triangles) std::swap(t[1], t[2]);
        Mesh mesh = front_first ? front : back;
        const Mesh& other = front_first ? back : front;
        mesh.positions.insert(mesh.positions.end(), other.positions.begin(), other.positions.end());
        mesh.colours.insert(mesh.colours.end(), other.colours.begin(), other.colours.end());
        for (const auto& t : other.triangles) mesh.triangles.push_back({t[1] + 4, t[2] + 4, t[0] + 4});
        add_rectangle(mesh, {20, 20}, {21, 21}, 0, grey(0.5f)); // else the two would be closed
        const Scene scene(mesh);
        ASSERT_EQ(scene.tree.closedness(), unseen::vdtree::Closedness::open);
        View view = frontal_view(32, 32);
        for (const double aside : {0.0, 0.3}) {
            view.eye = {aside, -aside, 1};
            EXPECT_THAT(draw(scene, view).luminance, ::testing::Each(::testing::FloatNear(0.75f, value_tolerance)));
            view.eye = {aside, -aside, -1};
            EXPECT_THAT(draw(scene, view).luminance, ::testing::Each(::testing::FloatNear(0.25f, value_tolerance)));
        }
    }
}

TEST_F(RendererTest, DrawsOpenSurfacesFromBothSidesAlike) {
    const Scene scene(rectangle({-9, -9}, {9, 9}, 0, grey(0.5f)));
    View view = frontal_view(16, 16);
    view.eye = {0, 0, -1};
    const Frame frame = draw(scene, view);
    EXPECT_THAT(frame.luminance, ::testing::Each(::testing::FloatNear(0.5f, stored_tolerance)));
}

TEST_F(RendererTest, DrawsAnInsideOutMeshLikeItsMirrorImage) {
    const Scene outward(cube(true)), inward(cube(false));
    ASSERT_EQ(outward.tree.closedness(), unseen::vdtree::Closedness::closed_outward);
    ASSERT_EQ(inward.tree.closedness(), unseen::vdtree::Closedness::closed_inward);
    View view = frontal_view(64, 64);
    view.eye = {2.5, 3, 3.5};
    view.fov_y_degrees = 40;
    EXPECT_LT(difference(draw(outward, view), draw(inward, view)).largest, value_tolerance);

    DrawOptions options;
    options.samples = 1; // so that no pixel mixes
    for (const Scene* scene : {&outward, &inward}) {
        int seen[4] = {};
        const Frame frame = draw(*scene, view, options);
        for (float value : frame.luminance) {
            const float expected[4] = {options.background, 0.3f, 0.5f, 0.7f}; // the faces of +x, +y and +z
            const auto* nearest = std::min_element(std::begin(expected), std::end(expected), [&](float a, float b) {
                return std::abs(a - value) < std::abs(b - value);
            });
            EXPECT_NEAR(value, *nearest, value_tolerance);
            ++seen[nearest - expected];
        }
        EXPECT_THAT(seen, ::testing::Each(::testing::Gt(100))) << "all that faces the eye, and the background";
    }
}

TEST_F(RendererTest, ShowsAClosedMeshFromInside) {
    const Scene outward(cube(true)), inward(cube(false));
    for (glm::dvec3 eye : {glm::dvec3(0, 0, 0), glm::dvec3(0.99, 0.9, -0.9)}) {
        View view = frontal_view(32, 32);
        view.eye = eye;
        view.target = {-0.3, 0.2, -0.5};
        for (const Scene* scene : {&outward, &inward}) {
            DrawOptions options;
            options.background = 0;
            const Frame frame = draw(*scene, view, options);
            EXPECT_THAT(frame.luminance, ::testing::Each(::testing::Ge(0.19f))) << "there is a wall everywhere";
        }
    }
}

TEST_F(RendererTest, DrawsMeshesOfEverySize) {
    const Mesh mesh = bumpy_sphere(40);
    View view = frontal_view(96, 96);
    view.eye = {0.5, 1, 2};
    view.fov_y_degrees = 60;
    const Frame expected = draw(Scene(mesh), view);
    for (double size : {1e-19, 1e-3, 1e6, 1e30}) {
        const Scene scene(transformed(mesh, [=](glm::dvec3 p) { return p * size; }));
        View scaled = view;
        scaled.eye *= size;
        const Difference d = difference(draw(scene, scaled), expected);
        // Positions round differently: samples at edges flip.
        EXPECT_LT(d.mean, 1e-4) << size;
        EXPECT_LT(d.largest, 2 * sample_share) << size;

        Similarity placement; // the mesh brought back to size 1 by its unit
        placement.scale = 1 / size;
        const Difference placed = difference(draw(scene, view, {}, placement), expected);
        EXPECT_LT(placed.mean, 1e-4) << size;
        EXPECT_LT(placed.largest, 2 * sample_share) << size;
    }
}

TEST_F(RendererTest, DrawsMeshesFarFromTheWorldsOrigin) {
    const Mesh mesh = bumpy_sphere(40);
    View view = frontal_view(96, 96);
    view.eye = {0.5, 1, 2};
    view.fov_y_degrees = 60;
    const Frame expected = draw(Scene(mesh), view);
    for (double distance : {1e6, 5e6, 1e9}) {
        const glm::dvec3 offset(distance, -0.5 * distance, 0.25 * distance);
        const Scene scene(transformed(mesh, [=](glm::dvec3 p) { return p + offset; }));
        View moved = view;
        moved.eye += offset;
        moved.target += offset;
        const Difference d = difference(draw(scene, moved), expected);
        // In double, 1e9 leaves 1e-7 of the mesh's size: samples at edges flip, nothing else.
        EXPECT_LT(d.mean, 1e-4) << distance;
        EXPECT_LT(d.largest, 2 * sample_share) << distance;
    }
}

TEST_F(RendererTest, SeesNearAndFar) {
    // A mesh of size 1 from 1e-3 of its size away to 1e6 of it, in a field that keeps it as large as the window.
    for (double distance : {1e-3, 1.0, 1e3, 1e6}) {
        const Scene scene(rectangle({-1, -1}, {1, 1}, 0, grey(0.5f)));
        View view = frontal_view(32, 32);
        view.eye = {0, 0, distance};
        view.fov_y_degrees = 2 * std::atan(std::min(0.9 / distance, 5.0)) * 180 / std::acos(-1.0);
        const Frame frame = draw(scene, view);
        EXPECT_THAT(frame.luminance, ::testing::Each(::testing::FloatNear(0.5f, value_tolerance))) << distance;
    }
}

TEST_F(RendererTest, DrawsNothingFromBehindTheEye) {
    const Scene scene(rectangle({-9, -9}, {9, 9}, 5, grey(0.5f)));
    DrawOptions options;
    const Frame frame = draw(scene, frontal_view(16, 16), options);
    EXPECT_THAT(frame.luminance, ::testing::Each(options.background));
}

TEST_F(RendererTest, PlacesTheTreeInTheWorld) {
    const Mesh mesh = bumpy_sphere(40);
    Similarity placement;
    placement.scale = 0.01;
    placement.rotation = glm::angleAxis(0.7, glm::normalize(glm::dvec3(1, 2, 3)));
    placement.translation = {3, -4, 5};
    View view = frontal_view(96, 96);
    view.target = {3, -4, 5};
    view.eye = {3.02, -4, 5.01};
    const Frame placed = draw(Scene(mesh), view, {}, placement);
    const Scene moved(transformed(mesh, [&](glm::dvec3 p) { return placement.to_world(p); }));
    const Difference d = difference(placed, draw(moved, view));
    EXPECT_LT(d.mean, 1e-4);
    EXPECT_LT(d.largest, 2 * sample_share); // samples at edges flip
}

TEST_F(RendererTest, ShadesFlatWithTheMeanOfTheCorners) {
    const Scene scene(triangle({-3, -3, 0}, {5, -3, 0}, {-3, 5, 0}, 0.1f, 0.4f, 0.7f));
    DrawOptions options;
    options.shading = Shading::flat;
    const Frame frame = draw(scene, frontal_view(32, 32), options);
    EXPECT_THAT(frame.luminance, ::testing::Each(::testing::FloatNear(0.4f, stored_tolerance)));
}

// A ball, white on one side and red on the other, seen from where the light is and from behind.
TEST_F(RendererTest, DrawsColoursTimesTheLight) {
    const unseen::vdtree::Light light;
    const glm::dvec3 sun(light.direction);
    const auto facing = [&](bool white_is_lit, bool from_the_light) {
        Mesh mesh = unseen::shapes::icosphere(5);
        for (const glm::dvec3& p : mesh.positions)
            mesh.colours.push_back((glm::dot(p, sun) > 0) == white_is_lit ? glm::vec4(1) : glm::vec4(1, 0, 0, 1));
        const auto tree = unseen::support::built(mesh);
        Cut whole(tree);
        whole.unfold_all();
        View view;
        view.width = view.height = 65;
        view.eye = (from_the_light ? 4.0 : -4.0) * sun;
        const Frame frame = draw(tree, whole, view);
        const glm::vec3 colour = colour_at(frame, 32, 32);
        EXPECT_NEAR(at(frame, 32, 32), 0.2126 * colour.r + 0.7152 * colour.g + 0.0722 * colour.b, 1e-5);
        EXPECT_LE(*std::max_element(frame.colour.begin(), frame.colour.end()), 1 + value_tolerance);
        return colour;
    };
    const auto expect = [](glm::vec3 seen, glm::dvec3 wanted) {
        for (int k = 0; k < 3; ++k) EXPECT_NEAR(seen[k], wanted[k], 2e-3) << k; // corners are a degree off the axis
    };
    const double behind = 0.2 + 0.8 * 0.25; // ambient light, and that from the opposite side
    expect(facing(true, true), {1, 1, 1});
    expect(facing(true, false), {behind, 0, 0});
    expect(facing(false, true), {1, 0, 0});
    expect(facing(false, false), {behind, behind, behind});
}

TEST_F(RendererTest, DrawsUncolouredMeshesGreyUnderTheirLight) {
    Mesh mesh = rectangle({-9, -9}, {9, 9}, 0, grey(1));
    mesh.colours.clear();
    const Frame frame = draw(Scene(mesh), frontal_view(16, 16));
    const float lit = 0.8f * (0.2f + 0.8f * 0.59700935f); // n = +z under the default light
    EXPECT_THAT(frame.luminance, ::testing::Each(::testing::FloatNear(lit, stored_tolerance)));
    EXPECT_THAT(frame.colour, ::testing::Each(::testing::FloatNear(lit, stored_tolerance)));
}

// Distance in pixels from a line through two points, all in pixels.
double distance_from_line(glm::dvec2 p, glm::dvec2 a, glm::dvec2 b) {
    const glm::dvec2 along = glm::normalize(b - a);
    return std::abs((p.x - a.x) * along.y - (p.y - a.y) * along.x);
}

TEST_F(RendererTest, DrawsWireframesAtEdgesOnly) {
    const int n = 64;
    const glm::dvec2 a(-0.8, -0.7), b(0.8, -0.5), c(-0.1, 0.85);
    const auto in_pixels = [&](glm::dvec2 p) { return glm::dvec2((p.x + 1) * n / 2, (1 - p.y) * n / 2); };
    for (float luminance : {0.02f, 0.8f}) {
        const Scene scene(triangle({a, 0}, {b, 0}, {c, 0}, luminance, luminance, luminance));
        DrawOptions plain, wire;
        wire.wireframe = true;
        const Frame without = draw(scene, frontal_view(n, n), plain), with = draw(scene, frontal_view(n, n), wire);
        int on_edges = 0;
        for (int row = 0; row < n; ++row)
            for (int column = 0; column < n; ++column) {
                const glm::dvec2 p(column + 0.5, row + 0.5);
                const double off = std::min({distance_from_line(p, in_pixels(a), in_pixels(b)),
                                             distance_from_line(p, in_pixels(b), in_pixels(c)),
                                             distance_from_line(p, in_pixels(c), in_pixels(a))});
                const double change = std::abs(at(with, column, row) - at(without, column, row));
                if (off > 1.5) { // half a line and half a pixel's diagonal, and some
                    EXPECT_EQ(at(with, column, row), at(without, column, row)) << column << ", " << row;
                }
                on_edges += change > 0.1 * luminance;
            }
        EXPECT_GT(on_edges, 2 * n) << "lines are seen on luminance " << luminance;
        EXPECT_EQ(context().take_errors(), "");
    }
}

TEST_F(RendererTest, DrawsWireframesOfBothShadings) {
    const Scene scene(rectangle({-9, -9}, {9, 9}, 0, grey(0.5f))); // its diagonal crosses the window's centre
    DrawOptions options;
    options.wireframe = true;
    for (Shading shading : {Shading::smooth, Shading::flat}) {
        options.shading = shading;
        const Frame frame = draw(scene, frontal_view(33, 33), options);
        for (int i = 0; i < 33; ++i) {
            EXPECT_LT(at(frame, i, 32 - i), 0.35f) << "on the diagonal";
            if (std::abs(i - 16) > 2) EXPECT_NEAR(at(frame, i, i), 0.5, value_tolerance) << "off the diagonal";
        }
    }
}

TEST_F(RendererTest, HidesLinesBehindSurfaces) {
    Mesh mesh;
    add_rectangle(mesh, {-30, -5}, {10, 35}, 0, grey(0.5f)); // its diagonal passes the window by
    const Frame alone = draw(Scene(mesh), frontal_view(32, 32));
    for (int i = 0; i < 40; ++i) add_rectangle(mesh, {-1 + 0.05 * i, -1}, {-0.96 + 0.05 * i, 1}, -0.1, grey(0.9f));
    DrawOptions options;
    options.wireframe = true;
    const Frame frame = draw(Scene(mesh), frontal_view(32, 32), options);
    EXPECT_LT(difference(frame, alone).largest, value_tolerance);
}

TEST_F(RendererTest, LeavesTheSurfaceVisibleUnderDenseWireframes) {
    const Scene scene(bumpy_sphere(300)); // triangles of less than a pixel
    View view = frontal_view(64, 64);
    view.eye = {0, 0, 3};
    view.fov_y_degrees = 40;
    DrawOptions wire;
    wire.wireframe = true;
    const Frame without = draw(scene, view), with = draw(scene, view, wire);
    double sum_without = 0, sum_with = 0;
    for (int row = 28; row < 36; ++row)
        for (int column = 28; column < 36; ++column) {
            sum_without += at(without, column, row);
            sum_with += at(with, column, row);
        }
    EXPECT_LT(sum_with, 0.9 * sum_without) << "lines are there";
    EXPECT_GT(sum_with, 0.3 * sum_without) << "and do not cover everything";
}

TEST_F(RendererTest, DrawsACutWithoutTriangles) {
    const Scene scene(bumpy_sphere(10));
    const Cut folded(scene.tree);
    ASSERT_EQ(folded.triangle_count(), 0u);
    DrawOptions options;
    options.wireframe = true;
    const Frame frame = draw(scene.tree, folded, frontal_view(8, 8), options);
    EXPECT_THAT(frame.luminance, ::testing::Each(options.background));
}

// Where a picture of faces of one luminance each is the same for five pixels all around, another one must be so, too:
// nothing is torn open, and no face has anything of another one.
void expect_the_same_away_from_edges(const Frame& full, const Frame& other, const std::string& what) {
    constexpr int around = 5;
    int compared = 0, differing = 0;
    for (int row = around; row + around < full.height; ++row)
        for (int column = around; column + around < full.width; ++column) {
            const float expected = at(full, column, row);
            bool is_inside = true;
            for (int y = row - around; y <= row + around; ++y)
                for (int x = column - around; x <= column + around; ++x) is_inside &= at(full, x, y) == expected;
            if (!is_inside) continue;
            ++compared;
            differing += !(std::abs(at(other, column, row) - expected) <= 1e-3f);
        }
    EXPECT_GT(compared, full.width * full.height / 2) << what;
    EXPECT_EQ(differing, 0) << what << ": of " << compared << " pixels";
}

// Half of the cube, a tenth of it, and cuts that are fine on one side and coarse on the other; as they are, gliding, and
// under lights.
TEST_F(RendererTest, SidesOfSeamsStayApart) {
    Mesh mesh = cube(true, 24);
    for (std::size_t v = 0; v < mesh.positions.size(); v += 4) {
        const auto p = [&](std::size_t i) { return mesh.positions[v + i]; };
        mesh.normals.insert(mesh.normals.end(), 4, glm::normalize(glm::cross(p(1) - p(0), p(2) - p(0))));
    }
    unseen::vdtree::BuildOptions how;
    how.prelit = true;
    const auto tree = std::move(*require(unseen::vdtree::build_tree(mesh.view(), how)));
    ASSERT_TRUE(tree.has_seams());
    ASSERT_EQ(tree.place_count(), 24u * 24 * 6 + 2);
    View view = frontal_view(160, 160);
    view.eye = {2.2, 2.6, 3};
    unseen::vdtree::Lighting lighting;
    lighting.ambient = 0.1;
    lighting.lights.resize(1);
    lighting.lights[0].direction = glm::normalize(glm::dvec3(0.3, 0.7, 0.6));
    lighting.lights[0].intensity = 0.8;
    DrawOptions options[2];
    options[0].samples = options[1].samples = 1;
    options[1].lighting = lighting;
    auto renderer = require(Renderer::create(context(), tree));
    Cut cut(tree);
    cut.unfold_all();
    const Frame full[] = {std::move(*require(renderer->draw(cut, view, options[0]))),
                          std::move(*require(renderer->draw(cut, view, options[1])))};
    auto gliding = require(unseen::vdtree::Geomorph::create(tree, 1, 1));
    ASSERT_TRUE(gliding->step(cut, 0));
    const unseen::vdtree::Index all = tree.triangle_count();
    for (const bool is_uneven : {false, true})
        for (const unseen::vdtree::Index budget : {all / 2, all / 10}) {
            const auto wanted = require(unseen::vdtree::extent_criterion(tree, view, 1));
            const glm::dvec3 eye = is_uneven ? glm::dvec3(1.2, 0.9, 0.8) : view.eye * 50.0;
            ASSERT_TRUE(cut.follow(*wanted, {.eye = eye - tree.origin()}, {.triangle_budget = budget}));
            const std::string what = std::to_string(cut.triangle_count()) + (is_uneven ? " unevenly" : "");
            for (int lit = 0; lit < 2; ++lit)
                expect_the_same_away_from_edges(full[lit], *require(renderer->draw(cut, view, options[lit])),
                                                what + (lit ? ", lit" : ""));
            for (int step = 0; step < 3; ++step) {
                ASSERT_TRUE(gliding->step(cut, step * 0.5));
                EXPECT_EQ(gliding->is_gliding(), step < 2);
                expect_the_same_away_from_edges(full[0], *require(renderer->draw(*gliding, view, options[0])),
                                                what + ", gliding");
            }
        }
}

TEST_F(RendererTest, MeasuresTheTimeOfDrawing) {
    const Scene scene(bumpy_sphere(30));
    View view = frontal_view(64, 64);
    view.eye = {0, 0, 3};
    const Frame frame = draw(scene, view);
    EXPECT_GT(frame.draw_ms, 0);
    EXPECT_LT(frame.draw_ms, 60e3);
}

TEST_F(RendererTest, SurvivesMovesOfEverything) {
    const Scene scene(rectangle({-9, -9}, {9, 9}, 0, grey(0.5f)));
    auto made = require(Renderer::create(context(), scene.tree));
    Renderer renderer = std::move(*made);
    Context elsewhere = std::move(context());
    EXPECT_NEAR(require(renderer.draw(scene.cut, frontal_view(8, 8)))->luminance[0], 0.5, value_tolerance);
    context() = std::move(elsewhere);
    { const Renderer last = std::move(renderer); }
    EXPECT_EQ(context().take_errors(), "");
}

TEST_F(RendererTest, OutlivesTheHandleOfItsContext) {
    const Scene scene(rectangle({-9, -9}, {9, 9}, 0, grey(0.5f)));
    auto other = require(Context::headless());
    std::optional<Context> gone = std::move(*other);
    auto renderer = require(Renderer::create(*gone, scene.tree));
    gone.reset();
    EXPECT_NEAR(require(renderer->draw(scene.cut, frontal_view(8, 8)))->luminance[0], 0.5, value_tolerance);
}

TEST_F(RendererTest, TakesTurnsWithARendererOfAnotherContext) {
    const Scene half(rectangle({-9, -9}, {9, 9}, 0, grey(0.5f))), quarter(rectangle({-9, -9}, {9, 9}, 0, grey(0.25f)));
    auto other_context = require(Context::headless());
    auto other = require(Renderer::create(*other_context, quarter.tree));
    auto renderer = require(Renderer::create(context(), half.tree));
    for (int i = 0; i < 3; ++i) {
        const auto a = renderer->draw(half.cut, frontal_view(8, 8));
        const auto b = other->draw(quarter.cut, frontal_view(8, 8));
        ASSERT_TRUE(a && b);
        EXPECT_NEAR(a->luminance[5], 0.5, value_tolerance);
        EXPECT_NEAR(b->luminance[5], 0.25, value_tolerance);
    }
    EXPECT_EQ(other_context->take_errors(), "");
}

TEST_F(RendererTest, RefusesWhatCannotBeDrawn) {
    const Scene scene(rectangle({-1, -1}, {1, 1}, 0, grey(0.5f)));
    auto renderer = require(Renderer::create(context(), scene.tree));
    const auto why_not = [&](const View& view, const DrawOptions& options, const Similarity& placement) {
        const auto frame = renderer->draw(scene.cut, view, options, placement);
        EXPECT_EQ(context().take_errors(), "");
        return frame ? "drawn" : frame.error().message;
    };
    const View view = frontal_view(8, 8);
    const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
    using ::testing::HasSubstr;

    EXPECT_THAT(why_not(frontal_view(0, 8), {}, {}), HasSubstr("0x8"));
    EXPECT_THAT(why_not(frontal_view(8, -1), {}, {}), HasSubstr("8x-1"));
    for (int samples : {0, -1, 257, 1 << 30}) {
        DrawOptions options;
        options.samples = samples;
        EXPECT_THAT(why_not(view, options, {}), HasSubstr("samples"));
    }
    for (double background : {nan, infinity, -0.1, 1.5}) {
        DrawOptions options;
        options.background = static_cast<float>(background);
        EXPECT_THAT(why_not(view, options, {}), HasSubstr("background"));
    }
    for (double scale : {nan, infinity, 0.0, -1.0}) {
        Similarity placement;
        placement.scale = scale;
        EXPECT_THAT(why_not(view, {}, placement), HasSubstr("scale"));
    }
    Similarity nowhere;
    nowhere.translation.y = nan;
    EXPECT_THAT(why_not(view, {}, nowhere), HasSubstr("translation"));
    Similarity speck;
    speck.scale = 1e-60;
    EXPECT_THAT(why_not(view, {}, speck), HasSubstr("far away"));
    EXPECT_EQ(why_not(view, {}, {}), "drawn") << "a refusal leaves the renderer usable";
}

TEST_F(RendererTest, RefusesAFrameLargerThanTheDriverDraws) {
    const int side = largest_target_side() + 1;
    if (side > 32768) GTEST_SKIP() << "this driver draws every window that a view may ask for";
    const Scene scene(rectangle({-1, -1}, {1, 1}, 0, grey(0.5f)));
    auto renderer = require(Renderer::create(context(), scene.tree));
    const auto frame = renderer->draw(scene.cut, frontal_view(side, 1));
    ASSERT_FALSE(frame);
    EXPECT_EQ(frame.error().code, unseen::ErrorCode::unsupported);
    EXPECT_THAT(frame.error().message, ::testing::HasSubstr("smaller size"));
    EXPECT_TRUE(renderer->draw(scene.cut, frontal_view(8, 8))) << "a refusal leaves the renderer usable";
}

TEST_F(RendererTest, RefusesTheCutOfAnotherTree) {
    const Scene mine(rectangle({-1, -1}, {1, 1}, 0, grey(0.5f))), yours(rectangle({-1, -1}, {1, 1}, 0, grey(0.5f)));
    auto renderer = require(Renderer::create(context(), mine.tree));
    EXPECT_THAT(error_in(renderer->draw(yours.cut, frontal_view(8, 8))), ::testing::HasSubstr("another tree"));
}

} // namespace renderer_test
