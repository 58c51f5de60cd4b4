// Chooses discrete levels of detail by what the rest of the picture masks: the pipeline of Drettakis and others (2007).
//
//     auto control = session::LevelControl::create(context, session);
//     for (;;) {
//         const auto frame = control->draw(view); // one more frame
//         show(control->picture());
//     }
//
// A frame draws each object at its level, in layers of depth. For the objects that are tested in it, it maps how large a
// step of luminance goes unseen in what all other layers show together, draws the objects once more at a better level,
// and counts the pixels where that looks different by more. The counts of one frame decide in a later one: nothing is
// read back, and nothing waits for the GPU.
//
// Pictures have the shadows of the scene's lights. What masks a layer's objects has those that all else casts on them: in
// the combination without the layer, what is behind the objects is multiplied by the share of their light that these
// shadows leave them.
//
// It is a baseline, not a promise: what it counts is how many pixels differ visibly, a few of which it allows; and what
// lies behind an object counts as masking it. The fold tests of Session promise more, and Follower keeps that promise.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <unseen/render/context.h>
#include <unseen/render/target.h>
#include <unseen/session/level_chain.h>
#include <unseen/session/session.h>

namespace unseen::render {
class LayerPasses;
}

namespace unseen::session {

// Who says which level an object has.
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
    int map_block = 1;        // a map's threshold is of so many by so many pixels, 1 to 16
    bool half_floats = false; // pictures of layers; of modern maps 1% is lost, of rpg99 in smooth pictures more
    // Of all pixels, how many may differ visibly: an object gets a better level above the one, a worse one below the other.
    double upper_share = 450.0 / (512 * 512), lower_share = 170.0 / (512 * 512);
    int frames_a_layer =
        4; // objects of the nearest layer are tested every so many frames, of the second every twice so many
    bool maps_all_layers = false; // also those of which no object is tested
    int fade_frames =
        0; // that two levels of an object share its pixels for where it changes; it is not tested meanwhile
};

enum class LevelDecision { better, keep, worse };

// What came of the test of one object.
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
    // That became known since the frame before.
    std::vector<LevelTest> tests;
    std::vector<LevelTimes> times;
};

// Move-only. Refers to the session, whose scene must not change; keeps a handle to the context, on whose thread it is
// used. The session's gaze, time and display count.
class LevelControl {
public:
    // Measures what the session's fold test needs, and makes the levels of all objects: seconds. `view`: for the fold
    // test, as in Session::recipe(). Fails where Session::prepare() does, on options out of range, and where the graphics
    // memory does not suffice.
    static Result<LevelControl> create(const render::Context& context, Session& session, const vdtree::View& view,
                                       const LevelControlOptions& options = {}, Request request = {});
    LevelControl(LevelControl&&) noexcept;
    LevelControl& operator=(LevelControl&&) noexcept;
    ~LevelControl();

    // One frame. Objects begin with the worst level and are tested against the best one in each frame until they keep
    // one; then by turns. Fails as drawing does. Counts that are not there yet decide later.
    Result<LevelFrame> draw(const vdtree::View& view);

    // LevelControlOptions::bias, from the next frame on; above 0 and finite.
    void set_bias(double bias);

    // Of the method `given`, from the next frame on, by object; -1 and levels that an object lacks: its last one.
    void set_levels(std::span<const int> levels);

    // Waits for the GPU, and lets what it has counted decide: for programs that write each frame down, and not for those
    // that show it. Only tests and times of what it returns are filled in.
    Result<LevelFrame> wait();

    // Frames of this view until nothing changes any more, at most so many; waits for the GPU after each. The last frame,
    // with all tests and times since the first.
    Result<LevelFrame> settle(const vdtree::View& view, int most_frames = 200);

    // Of the last frame: whether every object in sight was tested since a level last changed, and kept its own.
    bool is_settled() const noexcept;

    // Preconditions of what refers to pictures: the last draw() succeeded. Of others' sizes that cannot be drawn the old
    // picture stays; where memory runs out there is none.
    const render::Target& picture() const noexcept;      // of the last frame: linear RGB, relative luminance
    const render::LayerPasses& layers() const noexcept;  // of the last frame
    Result<void> combine(int left_out);                  // of the last frame, for people to look at
    Result<std::vector<float>> thresholds(int left_out); // the map of that combination, cd/m2; waits
    Result<std::vector<int>> read_levels();              // by pixel; -1: no object; draws and waits
    int map_width() const noexcept;
    int map_height() const noexcept;

    const LevelChain& chain(std::size_t object) const noexcept; // objects of one tree share it

private:
    struct Impl;
    explicit LevelControl(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace unseen::session
