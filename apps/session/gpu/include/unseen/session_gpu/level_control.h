// Chooses discrete levels of detail by what the rest of the picture masks: the pipeline of Drettakis and others (2007).
//
//     auto control = session::LevelControl::create(context, session);
//     for (;;) {
//         const auto frame = control->draw(view); // one more frame
//         show(control->picture());
//     }
//
// A frame draws each object at its level, in layers of depth. Some objects are tested in each frame: the frame maps the
// smallest visible step of luminance in the combination of all other layers, draws these objects once more at a better
// level, and counts the pixels that differ by more. The counts of one frame decide in a later one, so nothing waits for
// the GPU.
//
// Pictures have the shadows of the scene's lights. Shadows that other objects cast on a layer count as maskers: in the
// combination without the layer, the background of its objects is multiplied by the share of light that they get.
//
// This is a baseline, not a guarantee: it allows a few pixels to differ visibly, and it counts whatever lies behind an
// object as masking it. The fold tests of Session are stricter; use Follower for these.
#pragma once

#include <unseen/render/target.h>
#include <unseen/session/session.h>

namespace unseen::render {
class LayerPasses;
}

namespace unseen::session {

// How levels are chosen.
enum class LevelMethod {
    perceptual, // what is seen of a better one, see above
    distance,   // the farthest-reaching level that nobody sees from where the eye is, LevelChain::unseen_from()
    area,       // the one with so many triangles for each pixel that the bounding sphere covers
    given,      // set_levels(); of the chains of selection_chain() with so many levels as the options' chain
};
enum class MapRecipe {
    modern, // perception::threshold_map_modern()
    rpg99,  // perception::rpg99_map() of the combination alone, as in the paper
};

struct LevelControlOptions {
    LevelMethod method = LevelMethod::perceptual;
    double bias = 1; // of distance and area: above 1 finer levels, below coarser ones; above 0

    LevelChainOptions chain = {};
    int layers = 5; // of depth, 1 to 16
    MapRecipe maps = MapRecipe::modern;
    // Shares of all pixels that differ visibly: an object gets a better level above the upper, a coarser one below the
    // lower.
    double upper_share = 450.0 / (512 * 512), lower_share = 170.0 / (512 * 512);
    // With modern maps the upper one is at most this share of the disc around the object: a small one may not differ all
    // over. The paper has no such limit.
    double object_share = 0.001;
    // Objects of the nearest layer are tested every so many frames, of the second every twice so many.
    int frames_a_layer = 4;
    int fade_frames = 0; // that two levels of an object share its pixels for where it changes; no tests meanwhile
};

enum class LevelDecision { better, keep, worse };

// The result of testing one object.
struct LevelTest {
    std::uint64_t frame = 0; // that it was drawn in
    std::size_t object = 0;
    int level = 0, compared_with = 0;
    std::uint64_t pixels = 0; // that differ visibly: P_pass
    LevelDecision decision = LevelDecision::keep;
};

// On the GPU, milliseconds.
struct LevelTimes {
    std::uint64_t frame = 0;
    double layers_ms = 0, combinations_ms = 0, maps_ms = 0, depth_ms = 0, control_ms = 0;
};

struct LevelFrame {
    std::uint64_t number = 0;     // from 0
    std::vector<int> levels;      // by object, as drawn; -1: out of the window
    std::vector<int> tested_with; // by object: the level that it was drawn at once more; -1: not tested
    std::uint64_t triangles = 0;  // of objects
    int layers = 0;               // that hold objects; 0: one, which is drawn at once
    int surface_passes = 0, full_screen_passes = 0;
    int masked_layers = 0; // of those that were mapped, on whose objects others cast shadows; each is a surface pass
    int shadow_maps = 0;   // of the picture; 0: no light casts any
    int shadow_passes = 0; // that drew maps of shadows: for the picture, for masks, and for tests
    int changed = 0;       // objects that have another level than in the frame before
    std::uint64_t texture_bytes = 0;
    // Results that arrived since the frame before.
    std::vector<LevelTest> tests;
    std::vector<LevelTimes> times;
};

// Move-only. Shares the session, whose gaze, time and display count, and the context, on whose thread it is used.
class LevelControl {
public:
    // Measures folds if the session's fold test needs that, and makes the levels of all objects, which takes seconds.
    // `view`: for the fold test, as in Session::recipe(). Fails where Session::prepare() does, on options out of range,
    // and if graphics memory runs out.
    static Result<LevelControl> create(const render::Context& context, Session& session, const vdtree::View& view,
                                       const LevelControlOptions& options = {}, Request request = {});
    LevelControl(LevelControl&&) noexcept = default;
    LevelControl& operator=(LevelControl&&) noexcept = default;

    // Draws one frame. Objects begin at the coarsest level and are tested against the best one in each frame until they
    // keep a level, then by turns. Fails where drawing does.
    Result<LevelFrame> draw(const vdtree::View& view);

    // LevelControlOptions::bias, from the next frame on; above 0 and finite.
    void set_bias(double bias);

    // Sets the levels of the method `given`, from the next frame on, by object; -1 and levels that an object lacks: its
    // last one.
    void set_levels(std::span<const int> levels);

    // Waits for the GPU and applies its counts: for programs that write frames to files. Only `tests` and `times` of
    // the result are filled in.
    Result<LevelFrame> wait();

    // Draws this view until nothing changes any more, at most `most_frames` times; waits for the GPU after each frame.
    // Returns the last frame with all tests and times.
    Result<LevelFrame> settle(const vdtree::View& view, int most_frames = 200);

    // Whether every object in sight was tested since a level last changed, and kept its level.
    bool is_settled() const noexcept;

    // Precondition of the functions below: the last draw() succeeded. If a size cannot be drawn at all, the old picture
    // stays; if memory runs out, there is no picture.
    const render::Target& picture() const noexcept;      // of the last frame: linear RGB, relative luminance
    const render::LayerPasses& layers() const noexcept;  // of the last frame
    Result<std::vector<float>> thresholds(int left_out); // the map of that combination, cd/m2; waits
    Result<std::vector<int>> read_levels();              // by pixel; -1: no object; draws and waits
    int map_width() const noexcept;
    int map_height() const noexcept;

    const LevelChain& chain(std::size_t object) const noexcept; // objects of one tree share it

private:
    struct Impl;
    explicit LevelControl(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::session
