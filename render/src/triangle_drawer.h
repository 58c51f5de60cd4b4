// Draws indexed triangles: knows vertices, matrices and targets, nothing of trees and cuts.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include <glm/common.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <render/framebuffer.h>
#include <render/gl_object.h>
#include <render/program.h>
#include <render/renderer.h>
#include <vdtree/function_ref.h>
#include <vdtree/geomorph.h>

#include "camera.h"
#include "gpu_indices.h"
#include "surface_texture.h"
#include "vertex.h"
#include "vertex_mover.h"

namespace unseen::render {

// Which faces are left out.
enum class Cull { nothing, back, front };

// The vertices as they lie in memory; all spans but `colours`, which may be empty, are equally long.
struct VertexArrays {
    std::span<const glm::vec3> positions; // mesh units
    std::span<const vdtree::Unorm16> luminance; // relative, linear
    std::span<const glm::vec4> colours;   // linear; only their hue and saturation count
    UnitFrame frame;                      // that the positions are uploaded in
    std::span<const glm::vec2> uvs = {};  // where there is a texture
    vdtree::TextureView texture = {};     // multiplied with the colours; empty: none
};

// Of vertices, in the unit frame; empty at first.
struct Box {
    glm::vec3 low = glm::vec3(std::numeric_limits<float>::infinity()), high = -low;
    void include(glm::vec3 p) { low = glm::min(low, p), high = glm::max(high, p); }
};

// How triangles look.
struct SurfaceStyle {
    Shading shading = Shading::smooth;
    bool wireframe = false;
    Cull cull = Cull::nothing;
    float background = 0; // relative luminance, grey
    bool is_lit = false;  // by set_lights()
};

// Lights as the shader wants them: see surface.vert.
struct LightUniforms {
    glm::vec4 material = glm::vec4(0), eye = glm::vec4(0);
    std::vector<glm::vec4> lights; // three each
};

// Move-only; needs a current context for everything. GL errors are left for the caller to ask for.
class TriangleDrawer {
public:
    static Result<TriangleDrawer> create(const VertexArrays& vertices);

    // The triangles of all draws until the next call; corners are vertex numbers. Uploads what has changed since the last
    // call, where the state knows it. Fails where the memory does not suffice; then there are no triangles.
    Result<void> set_triangles(const IndexState& state);

    // Until the next call the `moved` vertices have these values, all others those of `vertices`, which are the ones that the drawer was
    // made with. Nothing at all is done, or made, while no vertex is, or was, moved.
    Result<void> set_moved(const VertexArrays& vertices, std::span<const vdtree::MovedVertex> moved);

    // For all lit draws until the next call. `vertices`: as many as the drawer has; called when lights are first set.
    Result<void> set_lights(LightUniforms lights, const FunctionRef<std::vector<LitVertex>()>& vertices);

    // By the last set_triangles() and set_moved().
    std::uint64_t uploaded_bytes() const noexcept { return indices_.uploaded_bytes() + moves_.size() * sizeof(VertexMove); }

    // The mean over the matrices of the image that each gives: width x height pixels of linear RGB and relative
    // luminance, row-major from the top left. The pixels belong to the drawer and stay until its next draw.
    Result<std::span<const glm::vec4>> draw(int width, int height, std::span<const glm::mat4> clip_from_unit,
                                            const SurfaceStyle& style);

    // One image into the window's framebuffer, encoded as sRGB.
    Result<void> draw_to_window(int width, int height, const glm::mat4& clip_from_unit, const SurfaceStyle& style);

private:
    enum class Target { image, window, window_to_encode };

    explicit TriangleDrawer(GpuIndices indices) : indices_(std::move(indices)) {}
    Result<void> upload(const VertexArrays& vertices);
    Result<void> fit_targets(int width, int height);
    Result<const Program*> program_for(const SurfaceStyle& style, Target target);
    // `lod_bias`: of the texture, negative where the images that are added up are finer than one.
    void draw_surface(const Program& program, const glm::mat4& clip_from_unit, const SurfaceStyle& style, float lod_bias) const;
    void add_sample_to_sum(float background) const;

    Buffer vertices_;
    std::uint64_t vertex_count_ = 0;
    std::optional<VertexMover> mover_;        // made when the first vertex is moved
    std::vector<std::uint32_t> moved_;        // that are not where they belong, ascending
    std::vector<VertexMove> moves_;           // the last ones
    GpuIndices indices_;
    VertexArray surface_arrays_;
    VertexArray no_arrays_; // for the full-screen triangle, which comes from nowhere
    Box box_;               // around all vertices, and around wherever they were moved
    glm::vec4 lowest_shade_ = glm::vec4(std::numeric_limits<float>::max()); // of all vertices
    glm::vec4 highest_shade_ = glm::vec4(std::numeric_limits<float>::lowest());
    glm::vec4 highest_hue_ = glm::vec4(1); // of all vertices: the shade over its luminance
    std::optional<SurfaceTexture> texture_; // made where the model has one
    std::optional<Buffer> lit_vertices_;   // made when lights are first set
    LightUniforms lights_;
    std::array<std::optional<Program>, 24> programs_; // 3 targets x lit x shading x wireframe, made when first used
    std::optional<Program> accumulate_;
    Framebuffer sample_;
    Framebuffer sum_;
    std::vector<glm::vec4> pixels_;
};

} // namespace unseen::render
