// Contexts of others, adopted; and the sample that draws a followed cut in plain OpenGL, against the renderer.
#include <initializer_list>

#include <EGL/egl.h>
#include <EGL/eglext.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <glm/gtc/matrix_transform.hpp>

#include <unseen/render/renderer.h>

#include "built.h"
#include "plain_gl.h"
#include "scenes.h"
#include "shapes.h"
#include "virtual_display.h"

namespace {

using namespace unseen;
using namespace unseen::render;
using render::testing::Scene;
using vdtree::Cut;
using vdtree::View;

// A context as a client makes one, without Unseen.
class EglContext {
public:
    explicit EglContext(int major = 4, int minor = 5) {
        const auto get_display =
            reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(eglGetProcAddress("eglGetPlatformDisplayEXT"));
        if (!get_display) return;
        display_ = get_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
        if (!display_ || !eglInitialize(display_, nullptr, nullptr) || !eglBindAPI(EGL_OPENGL_API)) return;
        const EGLint wanted[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
        EGLConfig config = nullptr;
        EGLint count = 0;
        if (!eglChooseConfig(display_, wanted, &config, 1, &count) || count == 0) return;
        const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                                     major,
                                     EGL_CONTEXT_MINOR_VERSION,
                                     minor,
                                     EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                     EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                     EGL_NONE};
        context_ = eglCreateContext(display_, config, EGL_NO_CONTEXT, attributes);
        make_current();
    }
    EglContext(const EglContext&) = delete;
    EglContext& operator=(const EglContext&) = delete;
    ~EglContext() { end(); }

    bool is_there() const { return context_ != EGL_NO_CONTEXT; }
    void make_current() const { eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_); }
    void let_go() const { eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT); }
    void end() {
        if (!is_there()) return;
        if (eglGetCurrentContext() == context_) let_go();
        eglDestroyContext(display_, context_);
        context_ = EGL_NO_CONTEXT;
    }

private:
    EGLDisplay display_ = EGL_NO_DISPLAY;
    EGLContext context_ = EGL_NO_CONTEXT;
};

class Display : public ::testing::Environment {
public:
    void SetUp() override { display_ = std::make_unique<render::testing::VirtualDisplay>(); }
    void TearDown() override {
        glfwTerminate();
        display_.reset();
    }
    static const std::string& reason() { return display_->reason(); }

private:
    static inline std::unique_ptr<render::testing::VirtualDisplay> display_;
};
const ::testing::Environment* const display = ::testing::AddGlobalTestEnvironment(new Display);

#define SKIP_WITHOUT(egl)                                                                                              \
    if (!(egl).is_there()) GTEST_SKIP() << "no surfaceless EGL with OpenGL 4.5"

constexpr int window_px = 192;

View some_view() {
    return {.eye = {1.1, 0.9, 2.4}, .target = {0, 0, 0}, .fov_y_degrees = 40, .width = window_px, .height = window_px};
}

Result<Frame> drawn_in(const Context& context, const Scene& scene, const View& view = some_view()) {
    auto renderer = Renderer::create(context, scene.tree);
    if (!renderer) return renderer.error();
    return renderer->draw(scene.cut, view, {.samples = 4});
}

TEST(Adopt, NeedsAContextThatIsCurrent) {
    EglContext egl;
    SKIP_WITHOUT(egl);
    egl.let_go();
    EXPECT_THAT(error_in(Context::adopt()), ::testing::HasSubstr("make yours current"));
}

// In a process of its own, for Mesa reads the variable once: see CMakeLists.txt.
TEST(AdoptOld, RefusesContextsBefore45) {
    if (!std::getenv("MESA_GL_VERSION_OVERRIDE")) GTEST_SKIP() << "run by render_adopt_old";
    EglContext egl(3, 3);
    SKIP_WITHOUT(egl);
    const std::string version = reinterpret_cast<const char*>(glGetString(GL_VERSION));
    if (version[0] == '4' && version[2] >= '5') GTEST_SKIP() << "this driver makes no older context than " << version;
    EXPECT_THAT(error_in(Context::adopt()),
                ::testing::AllOf(::testing::HasSubstr("4.5 is needed"), ::testing::HasSubstr("3.3")));
}

TEST(Adopt, DrawsAsInAContextOfItsOwn) {
    const Scene scene(render::testing::bumpy_sphere(24));
    const auto own = Context::headless();
    if (!own) GTEST_SKIP() << own.error().message;
    const auto expected = require(drawn_in(*own, scene));
    EglContext egl;
    SKIP_WITHOUT(egl);
    const auto adopted = Context::adopt([&] { egl.make_current(); });
    ASSERT_TRUE(adopted) << adopted.error().message;
    EXPECT_EQ(require(drawn_in(*adopted, scene))->luminance, expected->luminance);
    EXPECT_EQ(adopted->take_errors(), "");
}

// A state that no call of Unseen leaves behind by itself, and that of a program in the middle of its frame.
struct ClientState {
    GLuint buffers[3] = {}, textures[2] = {}, sampler = 0, array = 0, framebuffer = 0, program = 0;

    ClientState() {
        glCreateBuffers(3, buffers);
        for (const GLuint buffer : buffers) glNamedBufferStorage(buffer, 4096, nullptr, GL_DYNAMIC_STORAGE_BIT);
        glCreateTextures(GL_TEXTURE_2D, 1, &textures[0]);
        glTextureStorage2D(textures[0], 1, GL_RGBA8, 4, 4);
        glCreateTextures(GL_TEXTURE_CUBE_MAP, 1, &textures[1]);
        glTextureStorage2D(textures[1], 1, GL_RGBA8, 4, 4);
        glCreateSamplers(1, &sampler);
        glCreateVertexArrays(1, &array);
        glCreateFramebuffers(1, &framebuffer);
        glNamedFramebufferTexture(framebuffer, GL_COLOR_ATTACHMENT0, textures[0], 0);
        program = samples::make_plain_program();
        glUseProgram(program);
        glBindVertexArray(array);
        glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
        glBindBuffer(GL_PIXEL_UNPACK_BUFFER, buffers[0]);
        glBindBufferRange(GL_SHADER_STORAGE_BUFFER, 0, buffers[1], 256, 512);
        glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 1, buffers[2]);
        for (const GLuint unit : {0u, 1u, 2u}) {
            glBindTextureUnit(unit, textures[0]);
            glBindTextureUnit(unit, textures[1]);
            glBindSampler(unit, sampler);
        }
        glViewport(3, 4, 5, 6);
        glScissor(1, 2, 3, 4);
        glDepthRange(0.25, 0.75);
        glEnable(GL_SCISSOR_TEST);
        glEnable(GL_DITHER);
        glEnable(GL_STENCIL_TEST);
        glEnablei(GL_BLEND, 1);
        glDisablei(GL_BLEND, 0);
        glBlendFuncSeparatei(1, GL_DST_COLOR, GL_ZERO, GL_ONE, GL_SRC_ALPHA);
        glBlendEquation(GL_MAX);
        glColorMaski(2, GL_FALSE, GL_TRUE, GL_FALSE, GL_TRUE);
        glEnable(GL_CULL_FACE);
        glCullFace(GL_FRONT);
        glFrontFace(GL_CW);
        glPolygonMode(GL_FRONT_AND_BACK, GL_LINE);
        glDepthMask(GL_FALSE);
        glDepthFunc(GL_NOTEQUAL);
        glClipControl(GL_LOWER_LEFT, GL_NEGATIVE_ONE_TO_ONE);
        glPixelStorei(GL_UNPACK_ALIGNMENT, 2);
        glPixelStorei(GL_PACK_ROW_LENGTH, 77);
    }

    static std::vector<double> now() {
        std::vector<double> all;
        const auto add = [&](GLenum name) {
            GLdouble values[8] = {};
            glGetDoublev(name, values);
            all.insert(all.end(), values, values + 4);
        };
        for (const GLenum name : std::initializer_list<GLenum>{GL_CURRENT_PROGRAM,
                                                               GL_VERTEX_ARRAY_BINDING,
                                                               GL_DRAW_FRAMEBUFFER_BINDING,
                                                               GL_READ_FRAMEBUFFER_BINDING,
                                                               GL_PIXEL_UNPACK_BUFFER_BINDING,
                                                               GL_PIXEL_PACK_BUFFER_BINDING,
                                                               GL_SHADER_STORAGE_BUFFER_BINDING,
                                                               GL_VIEWPORT,
                                                               GL_SCISSOR_BOX,
                                                               GL_DEPTH_RANGE,
                                                               GL_SCISSOR_TEST,
                                                               GL_DITHER,
                                                               GL_STENCIL_TEST,
                                                               GL_DEPTH_TEST,
                                                               GL_CULL_FACE,
                                                               GL_CULL_FACE_MODE,
                                                               GL_FRONT_FACE,
                                                               GL_DEPTH_WRITEMASK,
                                                               GL_DEPTH_FUNC,
                                                               GL_CLIP_ORIGIN,
                                                               GL_CLIP_DEPTH_MODE,
                                                               GL_UNPACK_ALIGNMENT,
                                                               GL_PACK_ROW_LENGTH,
                                                               GL_MULTISAMPLE,
                                                               GL_FRAMEBUFFER_SRGB,
                                                               GL_ACTIVE_TEXTURE})
            add(name);
        GLint modes[2] = {};
        glGetIntegerv(GL_POLYGON_MODE, modes);
        all.push_back(modes[0]);
        for (GLuint i = 0; i < 4; ++i) {
            for (const GLenum name : std::initializer_list<GLenum>{
                     GL_BLEND_SRC_RGB, GL_BLEND_DST_RGB, GL_BLEND_SRC_ALPHA, GL_BLEND_DST_ALPHA, GL_BLEND_EQUATION_RGB,
                     GL_TEXTURE_BINDING_2D, GL_TEXTURE_BINDING_CUBE_MAP, GL_SAMPLER_BINDING,
                     GL_SHADER_STORAGE_BUFFER_BINDING}) {
                GLint value = 0;
                glGetIntegeri_v(name, i, &value);
                all.push_back(value);
            }
            GLint64 place = 0;
            glGetInteger64i_v(GL_SHADER_STORAGE_BUFFER_START, i, &place);
            all.push_back(static_cast<double>(place));
            GLboolean mask[4] = {};
            glGetBooleani_v(GL_COLOR_WRITEMASK, i, mask);
            all.insert(all.end(), mask, mask + 4);
            all.push_back(glIsEnabledi(GL_BLEND, i));
        }
        return all;
    }
};

TEST(Adopt, LeavesTheOwnersStateAsItWas) {
    EglContext egl;
    SKIP_WITHOUT(egl);
    const Scene scene(render::testing::bumpy_sphere(24));
    const auto expected = [&]() -> std::vector<float> {
        const auto context = Context::adopt();
        const auto frame = context ? drawn_in(*context, scene) : Result<Frame>(context.error());
        return frame ? frame->luminance : std::vector<float>{};
    }();
    const ClientState client;
    const std::vector<double> before = ClientState::now();
    ASSERT_EQ(glGetError(), static_cast<GLenum>(GL_NO_ERROR));
    {
        const auto adopted = require(Context::adopt());
        auto renderer = require(Renderer::create(*adopted, scene.tree));
        const auto frame = require(renderer->draw(scene.cut, some_view(), {.samples = 4}));
        EXPECT_EQ(frame->luminance, expected) << "the owner's state got into the picture";
        EXPECT_EQ(ClientState::now(), before);
    }
    EXPECT_EQ(ClientState::now(), before);
    EXPECT_EQ(glGetError(), static_cast<GLenum>(GL_NO_ERROR));
}

TEST(Adopt, SaysWhereTheContextIsNotCurrent) {
    EglContext egl, other;
    SKIP_WITHOUT(other);
    const Scene scene(render::testing::bumpy_sphere(12));
    egl.make_current();
    const auto adopted = require(Context::adopt());
    other.make_current();
    EXPECT_THAT(error_in(drawn_in(*adopted, scene)), ::testing::HasSubstr("not current"));
    egl.make_current();
    EXPECT_TRUE(drawn_in(*adopted, scene));
}

// The names of one context are those of others: what outlives its context must not be deleted in the next one.
TEST(Adopt, DeletesNothingOfAnotherContextWhenItsOwnIsGone) {
    std::optional<EglContext> egl(std::in_place);
    EglContext other;
    SKIP_WITHOUT(other);
    const Scene scene(render::testing::bumpy_sphere(12));
    egl->make_current();
    bool is_gone = false;
    auto adopted = Context::adopt([&] {
        if (!is_gone) egl->make_current();
    });
    ASSERT_TRUE(adopted) << adopted.error().message;
    std::optional<Renderer> renderer;
    {
        auto made = require(Renderer::create(*adopted, scene.tree));
        renderer.emplace(std::move(*made));
        ASSERT_TRUE(renderer->draw(scene.cut, some_view(), {.samples = 1}));
    }
    egl->end();
    is_gone = true;
    other.make_current();
    std::array<GLuint, 64> buffers = {}, textures = {}, arrays = {};
    glCreateBuffers(64, buffers.data());
    glCreateTextures(GL_TEXTURE_2D, 64, textures.data());
    glCreateVertexArrays(64, arrays.data());
    EXPECT_THAT(error_in(renderer->draw(scene.cut, some_view(), {.samples = 1})), ::testing::HasSubstr("is it gone"));
    other.make_current(); // the callback, or who was asked to let go, may have taken it off
    renderer.reset();
    adopted = Result<Context>(Error{ErrorCode::unsupported, ""});
    other.make_current();
    for (std::size_t i = 0; i < buffers.size(); ++i) {
        EXPECT_TRUE(glIsBuffer(buffers[i])) << i;
        EXPECT_TRUE(glIsTexture(textures[i])) << i;
        EXPECT_TRUE(glIsVertexArray(arrays[i])) << i;
    }
}

// The share of pixels that differ by more than rounding makes inside of a triangle.
double different_share(const std::vector<float>& a, const std::vector<float>& b) {
    EXPECT_EQ(a.size(), b.size());
    constexpr float rounding = 1e-3f; // relative luminance, whose storage has 16 bits; positions in floats move it, too
    std::size_t different = 0;
    for (std::size_t i = 0; i < a.size(); ++i) different += !(std::abs(a[i] - b[i]) <= rounding);
    return static_cast<double>(different) / static_cast<double>(a.size());
}

// Follows an orbit with the matrices of a client, patches, and compares the sample's last picture, and what its index
// buffer has become by patches, with the renderer's in the same, adopted context. `offset`: of the window's middle.
void expect_the_renderers_picture(const Context& context, glm::dvec2 offset) {
    const vdtree::VertexTree tree = support::built(shapes::bumpy_sphere(5, 0.03));
    constexpr double near_distance = 0.5, half = 0.35 * near_distance;
    const glm::dmat4 projection = glm::frustum(half * (offset.x - 1), half * (offset.x + 1), half * (offset.y - 1),
                                               half * (offset.y + 1), near_distance, 50.0);
    ASSERT_TRUE(context.make_current());
    samples::PlainCut drawn(tree);
    const GLuint program = samples::make_plain_program();
    GLint linked = 0;
    glGetProgramiv(program, GL_LINK_STATUS, &linked);
    ASSERT_TRUE(linked);
    Cut cut(tree);
    std::optional<vdtree::DistanceCriterion> criterion;
    std::size_t whole = 0, patched = 0;
    std::optional<View> view;
    glm::dmat4 view_from_world(1);
    for (int frame = 0; frame < 40; ++frame) {
        const double turn = 0.004 * frame;
        view_from_world = glm::lookAt(3.6 * glm::dvec3(std::sin(turn), 0.2, std::cos(turn)), glm::dvec3(0), {0, 1, 0});
        auto made = require(vdtree::view_from_matrices(view_from_world, projection, window_px, window_px));
        view = *made;
        if (!criterion) {
            auto of_view = require(vdtree::extent_criterion(tree, *view, 3));
            criterion = std::move(*of_view);
        }
        ASSERT_TRUE(cut.follow(*criterion, vdtree::viewpoint_of(tree, *view)));
        const std::size_t bytes = drawn.upload(cut);
        if (bytes > 0 && bytes < cut.indices().size_bytes()) ++patched;
        else if (bytes > 0) ++whole;
    }
    EXPECT_GT(patched, whole) << "nothing was patched";

    auto target =
        Target::create(context, window_px, window_px, {.colours = {ColourFormat::rgba32f, ColourFormat::rgba32f}});
    ASSERT_TRUE(target) << target.error().message;
    glNamedFramebufferDrawBuffer(target->id(), GL_COLOR_ATTACHMENT0);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, target->id());
    glViewport(0, 0, window_px, window_px);
    glClipControl(GL_UPPER_LEFT, GL_NEGATIVE_ONE_TO_ONE); // the first row on top, as the renderer's targets are
    glDisable(GL_SCISSOR_TEST);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_LESS);
    glClearColor(default_background, default_background, default_background, 1);
    glClearDepth(1);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    const glm::mat4 clip_from_tree(projection * view_from_world * glm::translate(glm::dmat4(1), tree.origin()));
    glUseProgram(program);
    glUniformMatrix4fv(0, 1, GL_FALSE, &clip_from_tree[0].x);
    drawn.draw();
    glUseProgram(0);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, 0);
    glClipControl(GL_LOWER_LEFT, GL_NEGATIVE_ONE_TO_ONE);
    glDeleteProgram(program);
    ASSERT_EQ(glGetError(), static_cast<GLenum>(GL_NO_ERROR));
    std::vector<float> plain;
    const auto pixels = require(read_pixels(*target));
    for (const glm::vec4& pixel : *pixels) plain.push_back(pixel.r);

    auto gpu_tree = require(GpuTree::create(context, tree));
    GpuCut gpu_cut(*gpu_tree);
    ASSERT_TRUE(gpu_cut.follow(cut));
    const Item item{.cut = gpu_cut};
    auto other = require(Target::create(context, window_px, window_px));
    ASSERT_TRUE(draw({&item, 1}, {.view = *view}, *other));
    const auto expected = require(read_luminance(*other));
    std::size_t covered = 0;
    for (const float value : *expected) covered += std::abs(value - default_background) > 0.01f;
    EXPECT_GT(covered, expected->size() / 10);
    // Edges: vertices are rounded to floats on two ways.
    EXPECT_LT(different_share(plain, *expected), 2e-3);
}

TEST(PlainGlSample, DrawsWhatTheRendererDrawsUnderEgl) {
    EglContext egl;
    SKIP_WITHOUT(egl);
    const auto context = require(Context::adopt());
    expect_the_renderers_picture(*context, {0, 0});
    expect_the_renderers_picture(*context, {0.3, -0.2});
}

TEST(PlainGlSample, DrawsWhatTheRendererDrawsInAWindow) {
    if (!Display::reason().empty()) GTEST_SKIP() << "no display: " << Display::reason();
    ASSERT_TRUE(glfwInit());
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 4);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 5);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    GLFWwindow* const window = glfwCreateWindow(64, 64, "Somebody else's", nullptr, nullptr);
    if (!window) GTEST_SKIP() << "no window with OpenGL 4.5";
    glfwMakeContextCurrent(window);
    {
        const auto context = Context::adopt([&] { glfwMakeContextCurrent(window); });
        ASSERT_TRUE(context) << context.error().message;
        expect_the_renderers_picture(*context, {0, 0});
        EXPECT_EQ(context->take_errors(), "");
        const auto own = Context::headless(); // takes the thread from the window, which takes it back
        ASSERT_TRUE(own) << own.error().message;
        EXPECT_TRUE(context->make_current());
        EXPECT_EQ(glfwGetCurrentContext(), window);
    }
    glfwDestroyWindow(window);
}

// A window off centre is a part of a larger one that is centred.
TEST(OffCentre, ShowsThePartOfALargerWindow) {
    const auto context = Context::headless();
    if (!context) GTEST_SKIP() << context.error().message;
    const Scene scene(render::testing::bumpy_sphere(24));
    View large = some_view();
    large.width = 300, large.height = 200;
    const int left = 170, top = 20, width = 100, height = 90; // of the part
    View part = large;
    part.width = width, part.height = height;
    const double half = std::tan(glm::radians(large.fov_y_degrees) / 2);
    part.fov_y_degrees = glm::degrees(2 * std::atan(half * height / large.height));
    part.shift = {(left + width * 0.5 - large.width * 0.5) / (width * 0.5),
                  -(top + height * 0.5 - large.height * 0.5) / (height * 0.5)};
    const auto whole = require(drawn_in(*context, scene, large)), seen = require(drawn_in(*context, scene, part));
    std::vector<float> cropped;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            cropped.push_back(whole->luminance[static_cast<std::size_t>((top + y) * large.width + left + x)]);
    EXPECT_LT(different_share(seen->luminance, cropped), 5e-3); // edges, as above
}

} // namespace
