// A window of your own in which a cut follows the camera: plain_gl MESH [FRAMES]. The camera's matrices are the
// program's, as an engine has them; Unseen is told them.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>

#include "plain_gl.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <glm/gtc/matrix_transform.hpp>

#include <unseen/meshio/mesh_file.h>
#include <unseen/perception/perception.h>
#include <unseen/vdtree/vdtree.h>

using namespace unseen;

namespace {

int fail(const Error& error) { return std::fprintf(stderr, "%s\n", error.message.c_str()), 1; }

int run(const char* file, int frames, GLFWwindow* window) {
    const auto mesh = meshio::read_mesh(file);
    if (!mesh) return fail(mesh.error());
    auto built = vdtree::build_tree(mesh->mesh.view());
    if (!built) return fail(built.error());
    const vdtree::Sphere ball = built->bounding_sphere();
    const glm::dvec3 centre = built->origin() + glm::dvec3(ball.centre);
    const double radius = ball.radius;
    auto tree = perception::measure_folds(*built); // once; keep it with vdtree::write_tree()
    if (!tree) return fail(tree.error());

    samples::PlainCut drawn(*tree);
    const GLuint program = samples::make_plain_program();
    vdtree::Cut cut(*tree);
    const perception::FoldTestOptions options; // the default display and observer
    std::optional<vdtree::DistanceCriterion> criterion;
    int of_width = 0, of_height = 0; // what the criterion is for

    std::size_t uploaded = 0;
    for (int frame = 0; frame < frames && !glfwWindowShouldClose(window); ++frame) {
        int width = 0, height = 0;
        glfwGetFramebufferSize(window, &width, &height);
        if (width == 0 || height == 0) { // as while it is hidden
            glfwWaitEvents();
            continue;
        }
        const double turn = glm::radians(0.5 * frame), fov_y = glm::radians(30.0);
        const glm::dmat4 view_from_world = glm::lookAt(
            centre + 4.5 * radius * glm::dvec3(std::sin(turn), 0.3, std::cos(turn)), centre, glm::dvec3(0, 1, 0));
        const glm::dmat4 clip_from_view =
            glm::perspective(fov_y, static_cast<double>(width) / height, 0.5 * radius, 20 * radius);

        const auto view = vdtree::view_from_matrices(view_from_world, clip_from_view, width, height);
        if (!view) return fail(view.error());
        if (width != of_width || height != of_height) { // slow: once a window's size or field, not once a frame
            auto made = perception::error_distances(*tree, *view, options);
            if (!made) return fail(made.error());
            criterion = std::move(*made);
            of_width = width, of_height = height;
        }
        const auto stats = cut.follow(*criterion, perception::viewpoint_of(*tree, *view, options)); // each frame
        if (!stats) return fail(stats.error());
        uploaded += drawn.upload(cut);

        // In doubles up to here: the tree's vertices are relative to its origin.
        const glm::mat4 clip_from_tree(clip_from_view * view_from_world *
                                       glm::translate(glm::dmat4(1), tree->origin()));
        glViewport(0, 0, width, height);
        glEnable(GL_DEPTH_TEST);
        glClearColor(0.2f, 0.2f, 0.2f, 1);
        glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
        glUseProgram(program);
        glUniformMatrix4fv(0, 1, GL_FALSE, &clip_from_tree[0].x);
        drawn.draw();
        glfwSwapBuffers(window);
        glfwPollEvents();
    }
    std::printf("%u of %u triangles; %.0f kB of indices uploaded\n", static_cast<unsigned>(cut.triangle_count()),
                static_cast<unsigned>(tree->triangle_count()), static_cast<double>(uploaded) / 1e3);
    glDeleteProgram(program);
    return glGetError() == GL_NO_ERROR ? 0 : 1;
}

} // namespace

int main(int argc, char** argv) {
    if (argc < 2) return std::fprintf(stderr, "Usage: plain_gl MESH [FRAMES]\n"), 2;
    const int frames = argc > 2 ? std::atoi(argv[2]) : 720;
    if (!glfwInit()) return std::fprintf(stderr, "There is no display.\n"), 1;
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 4);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 5);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_SRGB_CAPABLE, GLFW_TRUE);
    GLFWwindow* const window = glfwCreateWindow(640, 480, "A followed cut", nullptr, nullptr);
    int status = 1;
    if (window) {
        glfwMakeContextCurrent(window);
        glEnable(GL_FRAMEBUFFER_SRGB);
        status = run(argv[1], frames, window);
        glfwDestroyWindow(window);
    } else {
        std::fprintf(stderr, "There is no window with OpenGL 4.5.\n");
    }
    glfwTerminate();
    return status;
}
