// Draws a scene's items; what has to be found out about them is found out once for any number of draws.
#pragma once

#include "shadows_impl.h"
#include "target_impl.h"

namespace unseen::render {

inline constexpr int most_samples = 256; // beyond, a sum's rounding in float would outgrow what a sample adds to it

inline Result<void> check_samples(int samples) {
    if (samples >= 1 && samples <= most_samples) return {};
    return Error{ErrorCode::invalid_argument, "The samples a pixel must be from 1 to " + std::to_string(most_samples) +
                                                  ", not " + std::to_string(samples) + "."};
}

// Which pixels of a window things can show in.
class ShownPixels {
public:
    explicit ShownPixels(const vdtree::View& view) : view_(view) {}
    // What lies in the box, where each pixel is drawn at that point.
    void add(const Projection& projection, const Box& box, glm::dvec2 point);
    PixelBox box() const; // all of them where a part of something may lie behind the eye

private:
    vdtree::View view_;
    glm::dvec2 low_ = glm::dvec2(std::numeric_limits<double>::infinity()), high_ = -low_;
    bool is_behind_ = false;
};

// Everything that drawing depends on but for depth, blending and faces is set: a window's other users may have changed
// it.
void set_fixed_state(const Target::Impl& target);

// After which nothing else is drawn or cleared, until the fixed state is set again.
void set_scissor(const PixelBox& box);

// Lights as the shader wants them: see surface.vert.
struct LightUniforms {
    glm::vec4 material = glm::vec4(0), eye = glm::vec4(0);
    std::vector<glm::vec4> lights; // three each
};

// Needs a current context. GL errors are left for the caller to ask for.
class SurfacePass {
public:
    // Checks everything that can be wrong, compiles what is missing and aims at each item. The pass keeps the items'
    // cuts. Of the camera's point nothing is taken.
    // `use`: of a pass that compares, whose target has no colours, see compare(); of one that draws no colours, but in
    // all channels which share of its light the camera's shadows leave a surface.
    enum class Use { drawing, comparison, share_of_light };
    static Result<SurfacePass> prepare(std::span<const Item> items, const Camera& camera, const Target::Impl& target,
                                       int attachment, Use use = Use::drawing);

    // `sample_count`: of draws that will be averaged, each of which stands for so small a part of a pixel. `only`:
    // nothing else is touched. `least_share`: of a texel finer than that part, to be drawn where it is cut out in part.
    void draw(const Target::Impl& target, glm::dvec2 point, const Clear& clear, std::size_t sample_count = 1,
              const PixelBox* only = nullptr, float least_share = SurfaceTexture::by_pixels) const;

    // Draws nothing but what an occlusion query counts: where the items are at the target's depth, and do not look like
    // the picture that is bound. `compared`: as compare.frag has it.
    void compare(const Target::Impl& target, glm::dvec2 point, const glm::vec4& compared) const;

    // Which pixels of draws of these points can show anything: all of them where a part of an item may lie behind the
    // eye.
    PixelBox pixels_of(std::span<const glm::dvec2> points) const;

private:
    enum class Cull { nothing, back, front }; // faces that are left out

    struct PreparedItem {
        GpuCut cut;
        Projection projection;
        const Program* program = nullptr;
        Cull cull = Cull::nothing;
        bool is_lit = false, has_relief = false;
        LightUniforms lights = {};
        std::optional<glm::vec2> stipple = {}; // none: all pixels
        ShadowUniforms shadows = {};           // of layers, where its lights cast some
    };

    SurfacePass(const Camera& camera, int attachment, Output output)
        : view_(camera.view), tile_(camera.tile), attachment_(attachment), mask_(camera.shadow_mask), output_(output),
          shadows_(camera.shadows ? &camera.shadows->impl() : nullptr) {}
    static Cull cull_for(vdtree::Closedness closedness, bool eye_inside);
    void draw_item(const PreparedItem& item, glm::dvec2 point, float lod_bias,
                   float least_share = SurfaceTexture::by_pixels) const;
    void set_colours(const PreparedItem& item) const;

    vdtree::View view_;
    std::optional<Tile> tile_;
    int attachment_;
    std::optional<int> mask_; // the attachment of shadows' masks
    Output output_;
    Use use_ = Use::drawing;
    const Shadows::Impl* shadows_; // null: none are drawn
    std::vector<PreparedItem> items_;
};

// Each item's projection, with the near plane that is common to all: the given one, or that of the nearest item.
Result<std::vector<Projection>> projections_of(std::span<const Item> items, const vdtree::View& view,
                                               std::optional<double> near_plane);

} // namespace unseen::render
