// Drawing textures: the right texel in the right place, in linear light, and nothing of all that without one.

#define GL_GLEXT_PROTOTYPES 1
#include <GL/glcorearb.h>

#include <unseen/render/context.h>
#include <unseen/render/draw.h>
#include <unseen/render/internal/frame.h>
#include <unseen/render/renderer.h>
#include <unseen/vdtree/geomorph.h>
#include <unseen/vdtree/internal/light_bounds.h>
#include <unseen/vdtree/internal/texture_pyramid.h>

#include "built.h"
#include "shapes.h"
#include "sound.h"
#include "testing.h"
#include "textures.h"

namespace unseen::texture_test {

using vdtree::Cut;
using vdtree::Mesh;
using vdtree::Texture;
using vdtree::VertexTree;
using vdtree::View;

// Textures and colours are what is drawn.
VertexTree built(const Mesh& mesh) { return support::built(mesh, {.prelit = true}); }

constexpr glm::dvec3 rec709(0.2126, 0.7152, 0.0722);
constexpr double code_step = 3e-4; // of linear light: the rounding of half floats and of filters

Texture four_colours() {
    Texture texture{2, 2, {}, {}, {}};
    texture.texels = {{255, 0, 0, 255}, {30, 200, 90, 255}, {10, 20, 250, 255}, {128, 128, 128, 255}};
    return texture;
}

class Textured : public testing::Test {
protected:
    void SetUp() override {
        auto context = render::Context::headless();
        if (!context) GTEST_SKIP() << context.error().message;
        context_ = std::make_unique<render::Context>(std::move(*context));
    }
    // The square 0..n seen straight from the front, filling the window.
    render::Frame draw(const VertexTree& tree, int n, int window, render::DrawOptions options = {}) const {
        auto renderer = require(render::Renderer::create(*context_, tree));
        Cut cut(tree);
        cut.unfold_all();
        return std::move(*require(renderer->draw(cut, from_the_front(n, window), options)));
    }
    static View from_the_front(int n, int window) {
        View view;
        view.width = view.height = window;
        view.fov_y_degrees = 2 * std::atan(0.5 / 10) * 180 / 3.14159265358979;
        view.target = {n * 0.5, n * 0.5, 0};
        view.eye = view.target + glm::dvec3(0, 0, 10.0 * n);
        return view;
    }
    static glm::dvec3 colour(const render::Frame& frame, int x, int y) {
        const std::size_t i = 3 * static_cast<std::size_t>(y * frame.width + x);
        return {frame.colour[i], frame.colour[i + 1], frame.colour[i + 2]};
    }
    static double luminance(const render::Frame& frame, int x, int y) {
        return static_cast<double>(frame.luminance[static_cast<std::size_t>(y * frame.width + x)]);
    }
    static void expect_near(glm::dvec3 a, glm::dvec3 b, double tolerance) {
        for (int k = 0; k < 3; ++k) EXPECT_NEAR(a[k], b[k], tolerance) << k;
    }
    std::unique_ptr<render::Context> context_;
};

// Row 0 of the texture is where v is 0: at the bottom of this square.
TEST_F(Textured, TexelsAreDrawnWhereTheirCoordinatesSay) {
    const Texture texture = four_colours();
    for (const auto shading : {render::Shading::smooth, render::Shading::flat}) {
        const render::Frame frame = draw(built(textures::textured_grid(4, texture)), 4, 64, {.shading = shading});
        for (int i = 0; i < 2; ++i)
            for (int k = 0; k < 2; ++k) {
                const glm::dvec3 expected(vdtree::linear_colour(texture.texels[static_cast<std::size_t>(2 * k + i)]));
                const int x = 16 + 32 * i, y = 48 - 32 * k;
                // Beside a texel's centre filtering mixes in a little of the next.
                expect_near(colour(frame, x, y), expected, 0.04);
                EXPECT_NEAR(luminance(frame, x, y), glm::dot(colour(frame, x, y), rec709), 1e-5);
            }
    }
    // Halfway between texels: the mean of their light, not of their codes.
    const render::Frame frame = draw(built(textures::textured_grid(4, texture)), 4, 65);
    glm::dvec3 mean(0);
    for (const vdtree::Texel& texel : texture.texels) mean += glm::dvec3(vdtree::linear_colour(texel)) / 4.0;
    expect_near(colour(frame, 32, 32), mean, 0.01);
}

TEST_F(Textured, TexelsAreDecodedExactly) {
    Texture ramp{256, 1, {}, {}, {}};
    for (int code = 0; code < 256; ++code) {
        const auto c = static_cast<std::uint8_t>(code);
        ramp.texels.push_back({c, c, c, 255});
    }
    const render::Frame frame = draw(built(textures::textured_grid(1, ramp)), 1, 256, {.samples = 1});
    for (int code = 1; code < 255; ++code)
        EXPECT_NEAR(luminance(frame, code, 128), vdtree::linear_luminance(ramp.texels[static_cast<std::size_t>(code)]),
                    code_step)
            << code;
}

TEST_F(Textured, AreMultipliedWithTheColoursOfVertices) {
    Mesh mesh = textures::textured_grid(4, four_colours());
    mesh.colours.assign(mesh.positions.size(), {0.5f, 0.25f, 1.0f, 1});
    const render::Frame plain = draw(built(textures::textured_grid(4, four_colours())), 4, 64),
                        tinted = draw(built(mesh), 4, 64);
    for (const auto& [x, y] : {std::pair(10, 12), std::pair(48, 16), std::pair(33, 40)}) {
        const glm::dvec3 expected = colour(plain, x, y) * glm::dvec3(0.5, 0.25, 1);
        expect_near(colour(tinted, x, y), expected, 1e-4);
        EXPECT_NEAR(luminance(tinted, x, y), glm::dot(expected, rec709), 1e-4);
    }
}

TEST_F(Textured, AreLitByTheTreesLight) {
    const auto relit =
        built(textures::textured_grid(4, four_colours())).relit({.direction = {0, 0, 1}, .ambient = 0.5f});
    ASSERT_TRUE(relit);
    const auto aside =
        built(textures::textured_grid(4, four_colours())).relit({.direction = {1, 0, 0}, .ambient = 0.5f});
    ASSERT_TRUE(aside);
    const render::Frame bright = draw(*relit, 4, 64), dark = draw(*aside, 4, 64);
    expect_near(colour(dark, 16, 48), colour(bright, 16, 48) * 0.5, 1e-4);
}

// Fields of a tenth of a pixel: half of them white is half the light, an sRGB code of 188 and not of 128.
TEST_F(Textured, KeepTheirLightWhereTheyAreSmall) {
    for (const int samples : {1, 16}) {
        const render::Frame frame = draw(built(textures::textured_grid(4, textures::checkerboard(512, 512, 1, 0, 255))),
                                         4, 50, {.samples = samples});
        for (int x = 5; x < 45; x += 7) EXPECT_NEAR(luminance(frame, x, 25), 0.5, 0.02) << samples;
    }
    // Sides that no two divides, too.
    Texture texture{301, 77, {}, {}, {}};
    for (std::uint32_t i = 0; i < 301 * 77; ++i) {
        const std::uint8_t code = i % 3 == 0 ? 255 : 0;
        texture.texels.push_back({code, code, code, 255});
    }
    const render::Frame frame = draw(built(textures::textured_grid(4, texture)), 4, 16, {.samples = 1});
    EXPECT_NEAR(luminance(frame, 8, 8), 1.0 / 3, 0.02);
}

TEST_F(Textured, RepeatOrEndWhereTheySaySo) {
    using vdtree::Wrap;
    for (const Wrap wrap : {Wrap::repeat, Wrap::clamp, Wrap::mirror}) {
        Mesh mesh = textures::textured_grid(4, four_colours());
        mesh.texture.wrap_u = mesh.texture.wrap_v = wrap;
        for (glm::vec2& uv : mesh.uvs) uv = uv * 2.0f;
        const render::Frame frame = draw(built(mesh), 4, 64);
        const auto texel = [&](int i) {
            return glm::dvec3(vdtree::linear_colour(mesh.texture.texels[static_cast<std::size_t>(i)]));
        };
        expect_near(colour(frame, 8, 56), texel(0), 0.08);
        expect_near(colour(frame, 40, 24), texel(wrap == Wrap::repeat ? 0 : 3), wrap == Wrap::clamp ? code_step : 0.08);
        expect_near(colour(frame, 56, 8), texel(wrap == Wrap::mirror ? 0 : 3), wrap == Wrap::clamp ? code_step : 0.08);
    }
}

TEST_F(Textured, NothingIsMadeWithoutATexture) {
    const auto count = [] {
        int objects = 0;
        for (GLuint name = 1; name < 200; ++name) objects += glIsBuffer(name) + glIsTexture(name);
        return objects;
    };
    const VertexTree tree = built(textures::textured_grid(4, four_colours()));
    const auto plain = require(tree.untextured());
    const auto made_for = [&](const VertexTree& t) {
        const int before = count();
        auto renderer = render::Renderer::create(*context_, t);
        EXPECT_TRUE(renderer);
        return count() - before;
    };
    EXPECT_EQ(made_for(tree), made_for(*plain) + 2); // coordinates and image
    Mesh mesh = textures::textured_grid(4, four_colours());
    mesh.texture = {};
    const render::Frame without = draw(*plain, 4, 32), never = draw(built(mesh), 4, 32);
    EXPECT_EQ(without.luminance, never.luminance);
}

// Light times texel, plus the highlight, which the texture does not colour; white at most.
TEST_F(Textured, AreLitByLights) {
    const Texture texture = four_colours();
    const VertexTree tree = built(textures::textured_grid(4, texture));
    vdtree::LightSource sun;
    sun.direction = {0, 0, 1};
    for (const auto& [intensity, specular] : {std::pair(0.5, 0.0), std::pair(0.5, 0.04), std::pair(3.0, 0.0)}) {
        vdtree::Lighting lighting;
        lighting.ambient = 0.1;
        lighting.specular = specular;
        lighting.shininess = 1; // so that it hardly changes over the square
        lighting.lights = {sun};
        lighting.lights[0].intensity = intensity;
        for (const auto shading : {render::Shading::smooth, render::Shading::flat}) {
            render::DrawOptions options{.shading = shading};
            const render::Frame plain = draw(tree, 4, 64, options);
            options.lighting = lighting;
            const render::Frame lit = draw(tree, 4, 64, options);
            for (const auto& [x, y] : {std::pair(16, 16), std::pair(48, 16), std::pair(16, 48), std::pair(30, 33)}) {
                glm::dvec3 expected = colour(plain, x, y) * (0.1 + intensity) + intensity * specular * 9 / 8;
                expected /= std::max(1.0, glm::dot(expected, rec709));
                expect_near(colour(lit, x, y), expected, 1e-3);
                EXPECT_NEAR(luminance(lit, x, y), glm::dot(expected, rec709), 1e-3);
            }
        }
    }
}

// Any vertex under any texel, in the range of its node.
TEST_F(Textured, AreBoundedUnderLights) {
    Mesh mesh = textures::textured_sphere(3, textures::noise(40, 40, 6));
    for (std::size_t v = 0; v < mesh.positions.size(); ++v)
        mesh.colours.push_back({0.3f + 0.7f * static_cast<float>(v % 2), 0.8f, v % 3 ? 0.2f : 1.0f, 1});
    const VertexTree tree = built(mesh);
    const auto bounds = require(vdtree::LightBounds::measure(tree));
    vdtree::Lighting lighting;
    lighting.ambient = 0.1;
    lighting.specular = 0.05;
    lighting.shininess = 20;
    vdtree::LightSource sun;
    sun.direction = glm::normalize(glm::dvec3(0.4, 0.7, 0.6));
    sun.intensity = 0.8;
    lighting.lights = {sun};
    const glm::dvec3 eye(0, 0, 4);
    vdtree::Lighting dull = lighting;
    dull.specular = 0;
    for (vdtree::NodeId node = 0; node < tree.interior_count(); ++node) {
        const vdtree::LuminanceRange range =
            vdtree::lit_range(lighting, bounds->cones()[node], tree.bounds()[node].ring, eye);
        for (vdtree::Index leaf = support::sound(tree).first_leaf()[node]; leaf < support::sound(tree).leaf_end()[node];
             ++leaf) {
            const vdtree::WedgeId vertex = tree.wedge_of_leaf(leaf);
            const glm::dvec3 p(tree.positions()[vertex]), n(glm::vec3(tree.normals()[vertex])),
                rgb(tree.colours()[vertex]);
            const double light = vdtree::lit_luminance(dull, p, n, 1, eye),
                         both = vdtree::lit_luminance(lighting, p, n, 1, eye);
            const auto at = [&](float u) { return static_cast<std::size_t>((u - std::floor(u)) * 40) % 40; };
            const glm::vec2 uv = tree.uvs()[vertex];
            const glm::dvec3 texel(vdtree::linear_colour(mesh.texture.texels[at(uv.y) * 40 + at(uv.x)]));
            const double shown = std::min(1.0, glm::dot(rgb * texel, rec709) * light + (both < 1 ? both - light : 0));
            EXPECT_GE(range.hi, shown - 1e-5) << node;
            if (both < 1) EXPECT_LE(range.lo, shown + 1e-5) << node;
        }
    }
}

TEST_F(Textured, AnyNumberOfColumnsIsDrawn) {
    for (const std::uint32_t width : {1u, 3u, 5u, 7u}) {
        const Texture texture = textures::noise(width, 3, width);
        const int window = static_cast<int>(30 * width);
        const render::Frame frame = draw(built(textures::textured_grid(4, texture)), 4, window);
        for (std::uint32_t i = 0; i < width; ++i) {
            const glm::dvec3 expected(vdtree::linear_colour(texture.texels[width + i]));
            expect_near(colour(frame, static_cast<int>(30 * i + 15), window / 2), expected, 0.05);
        }
    }
}

// ---- texels that are not there

// `there` of each run of `of` columns.
Texture striped(std::uint32_t side, std::uint32_t there, std::uint32_t of) {
    Texture texture{side, side, {}, {}, {}};
    for (std::uint32_t i = 0; i < side * side; ++i)
        texture.texels.push_back({255, 255, 255, static_cast<std::uint8_t>(i % side % of < there ? 255 : 0)});
    return texture;
}

TEST_F(Textured, NothingIsDrawnWhereTexelsAreNotThere) {
    const VertexTree tree = built(textures::textured_grid(4, striped(8, 2, 4)));
    for (const auto shading : {render::Shading::smooth, render::Shading::flat})
        for (const bool wireframe : {false, true}) {
            const render::Frame frame =
                draw(tree, 4, 64, {.shading = shading, .wireframe = wireframe, .background = 0.25f});
            for (int x = 0; x < 64; ++x) {
                if (x % 16 == 0 || x % 16 == 15) continue; // an outline
                const bool is_there = x % 32 < 16;
                if (!is_there) EXPECT_EQ(luminance(frame, x, 13), 0.25) << x;
                else if (!wireframe) EXPECT_NEAR(luminance(frame, x, 13), 1, code_step) << x;
            }
        }
    auto gpu = require(render::GpuTree::create(*context_, tree));
    render::GpuCut gpu_cut(*gpu);
    Cut cut(tree);
    cut.unfold_all();
    ASSERT_TRUE(gpu_cut.follow(cut));
    const render::Item item{gpu_cut};
    const auto depth = require(render::farthest_depth(*context_, {&item, 1}, from_the_front(4, 64)));
    for (int x = 2; x < 64; ++x)
        if (x % 16 > 1 && x % 16 < 14)
            EXPECT_EQ(std::isinf((*depth)[static_cast<std::size_t>(64 * 13 + x)]), x % 32 >= 16) << x;
}

// However fine the texels are, and however many samples there are: as much is covered as texels are there.
TEST_F(Textured, CutOutsCoverTheShareThatIsThere) {
    for (const std::uint32_t there : {1u, 3u, 5u, 7u})
        for (const std::uint32_t side : {32u, 256u, 2048u}) {
            const VertexTree tree = built(textures::textured_grid(4, striped(side, there, 8)));
            const render::Frame frame = draw(tree, 4, 16, {.samples = 64, .background = 0});
            double mean = 0;
            for (int y = 0; y < 16; ++y)
                for (int x = 0; x < 16; ++x) mean += luminance(frame, x, y) / 256;
            EXPECT_NEAR(mean, there / 8.0, 0.04) << side; // all pixels are alike, and a sample is 0.016
        }
}

// Alpha says how many of a pixel's samples are drawn, also where texels are wide.
TEST_F(Textured, AlphaIsAShareWhereItBlends) {
    for (const int alpha : {0, 64, 200, 255}) {
        Texture texture{2, 2, {}, {}, {}};
        texture.texels.assign(4, {255, 255, 255, static_cast<std::uint8_t>(alpha)});
        texture.blends = true;
        const render::Frame frame =
            draw(built(textures::textured_grid(4, texture)), 4, 8, {.samples = 64, .background = 0.25f});
        const double share = alpha / 255.0;
        EXPECT_NEAR(luminance(frame, 3, 4), share + (1 - share) * 0.25, 1.0 / 64) << alpha;
    }
}

// ---- maps of light and of normals

TEST_F(Textured, ShineWhateverLightsThem) {
    Texture texture{1, 1, {}, {}, {{100, 100, 100, 255}}};
    texture.emission = {{90, 180, 30, 255}};
    const VertexTree tree = built(textures::textured_grid(4, texture));
    const glm::dvec3 own(vdtree::linear_colour(texture.texels[0])), light(vdtree::linear_colour(texture.emission[0]));
    expect_near(colour(draw(tree, 4, 8, {}), 4, 4), own + light, code_step);
    vdtree::Lighting dusk;
    dusk.ambient = 0.1;
    dusk.lights = {{.intensity = 0.5}}; // from the front
    expect_near(colour(draw(tree, 4, 8, {.lighting = dusk}), 4, 4), 0.6 * own + light, code_step);
}

glm::dvec3 code_of(glm::dvec3 normal) { return glm::round(128.0 + 127.0 * normal); }

// A map that tilts all normals alike, on a square before the eye: what the formulas of light say of such normals.
TEST_F(Textured, AreLitByTheNormalsOfTheirMap) {
    const vdtree::Light baked{.direction = glm::normalize(glm::vec3(0.5f, 0.3f, 0.8f)), .ambient = 0.1f, .fill = 0.25f};
    const auto baked_luminance = [&](glm::dvec3 n) {
        const double facing = glm::dot(n, glm::dvec3(baked.direction));
        return 0.1 + 0.9 * std::max(facing, 0.25 * -facing);
    };
    vdtree::Lighting lighting;
    lighting.ambient = 0.1;
    lighting.specular = 0.05;
    lighting.shininess = 8;
    lighting.lights = {{.intensity = 0.5, .direction = glm::normalize(glm::dvec3(-0.4, 0.6, 0.7))}};
    for (const glm::dvec3 tilt : {glm::dvec3(0, 0, 1), glm::dvec3(0.6, 0, 0.8), glm::dvec3(-0.36, 0.48, 0.8)})
        for (const bool is_mirrored : {false, true}) {
            const glm::dvec3 code = code_of(tilt);
            Texture texture{1, 1, {}, {}, {{188, 188, 188, 255}}};
            texture.relief = {{static_cast<std::uint8_t>(code.x), static_cast<std::uint8_t>(code.y),
                               static_cast<std::uint8_t>(code.z), 255}};
            Mesh mesh = textures::textured_grid(4, texture);
            for (glm::vec2& uv : mesh.uvs) uv.x = is_mirrored ? 1 - uv.x : uv.x;
            const VertexTree tree = support::built(mesh, {.light = baked});
            glm::dvec3 normal = glm::normalize((code - 128.0) / 127.0);
            if (is_mirrored) normal.x = -normal.x;
            const double albedo = vdtree::linear_luminance(texture.texels[0]);
            for (const bool wireframe : {false, true}) // by way of a geometry shader, away from the lines
                EXPECT_NEAR(luminance(draw(tree, 4, 32, {.wireframe = wireframe}), 14, 11),
                            albedo * baked_luminance(normal), 2e-3)
                    << tilt.x;
            const View view = from_the_front(4, 32);
            const double expected = vdtree::lit_luminance(lighting, {0, 0, 0}, normal, albedo,
                                                          view.eye - view.target); // the square is small from there
            EXPECT_NEAR(luminance(draw(tree, 4, 32, {.lighting = lighting}), 14, 11), expected, 5e-3) << tilt.x;
        }
    // Flat triangles show their own light, and pre-lit colours have theirs.
    Texture texture{1, 1, {}, {}, {{188, 188, 188, 255}}};
    texture.relief = {{255, 128, 128, 255}};
    const Mesh mesh = textures::textured_grid(4, texture);
    const double plain = vdtree::linear_luminance(texture.texels[0]);
    EXPECT_NEAR(luminance(draw(built(mesh), 4, 8, {}), 4, 4), plain, code_step);
    EXPECT_NEAR(luminance(draw(support::built(mesh, {.light = baked}), 4, 8, {.shading = render::Shading::flat}), 4, 4),
                plain * baked_luminance({0, 0, 1}), code_step);
}

TEST_F(Textured, MapsThatAreNotThereAreNotMade) {
    const auto made_for = [&](const VertexTree& tree) {
        GLuint before = 0, after = 0;
        glGenTextures(1, &before), glDeleteTextures(1, &before);
        const auto gpu = require(render::GpuTree::create(*context_, tree));
        glGenTextures(1, &after), glDeleteTextures(1, &after);
        return after - before;
    };
    static_cast<void>(require(render::GpuTree::create(*context_, built(textures::textured_grid(1, four_colours())))));
    Texture texture = four_colours();
    const auto without = made_for(built(textures::textured_grid(1, texture)));
    texture.emission = texture.relief = texture.texels;
    EXPECT_EQ(made_for(built(textures::textured_grid(1, texture))), without + 2);
}

} // namespace unseen::texture_test
