#include <unseen/session_gpu/level_control.h>

#include <algorithm>
#include <cmath>
#include <deque>

#include <glm/geometric.hpp>

#include <unseen/perception/internal/judge_tables.h>
#include <unseen/render/internal/difference_count.h>
#include <unseen/render/internal/elevation.h>
#include <unseen/render/internal/layers.h>
#include <unseen/render/internal/stage_times.h>
#include <unseen/render/shadows.h>
#include <unseen/session_gpu/gpu_judge.h>
#include <unseen/session_gpu/internal/level_pictures.h>

#include "shared_uploads.h"

namespace unseen::session {
namespace {

// A level that was too coarse is not tried again before the eye has moved by this share of its distance to the object:
// else the object would go to and fro between two levels.
constexpr double moved_share = 0.02;
// Nor, under lights that move, in so many of its tests.
constexpr int tests_until_retried = 16;

Error bad_option(const std::string& message) { return {ErrorCode::invalid_argument, "levels: " + message}; }

Result<void> check(const LevelControlOptions& o) {
    if (!(o.bias > 0 && std::isfinite(o.bias))) return bad_option("the bias must be above 0 and finite");
    if (!(o.lower_share >= 0 && o.upper_share >= o.lower_share && o.upper_share <= 1))
        return bad_option("shares of pixels lie between 0 and 1, and the lower one is not above the upper one");
    if (!(o.object_share >= 0 && o.object_share <= 1)) return bad_option("an object's share lies between 0 and 1");
    if (o.frames_a_layer < 1) return bad_option("objects are tested every frame at most");
    if (o.fade_frames < 0) return bad_option("a fade cannot last less than no frame");
    return {};
}

// After a frame of another size failed for want of memory.
Error no_picture() {
    return {ErrorCode::invalid_argument, "There is no picture: the last frame could not be drawn. Draw one first."};
}

// A light that casts shadows, in the world.
struct Caster {
    bool is_far = false;
    glm::dvec3 direction = glm::dvec3(0, 0, 1); // towards it, where it is far
    glm::dvec3 place = glm::dvec3(0);
};

std::vector<Caster> casting_lights(const vdtree::VertexTree& tree, const vdtree::Similarity& placement,
                                   const vdtree::Lighting& lighting) {
    std::vector<Caster> lights;
    for (const vdtree::LightSource& light : lighting.lights)
        if (light.casts_shadow)
            lights.push_back({light.kind == vdtree::LightSource::Kind::directional,
                              glm::normalize(placement.rotation * light.direction),
                              placement.to_world(tree.origin() + light.position)});
    return lights;
}

// Whether a shadow of what is in the one sphere may fall on what is in the other.
bool may_shade(const Caster& light, const WorldSphere& from, const WorldSphere& to) {
    const double both = from.radius + to.radius;
    if (light.is_far) {
        const glm::dvec3 off = from.centre - to.centre;
        const double ahead = glm::dot(off, light.direction);
        return ahead > -both && glm::length(off - ahead * light.direction) < both;
    }
    const glm::dvec3 a = from.centre - light.place, b = to.centre - light.place;
    const double far_a = glm::length(a), far_b = glm::length(b);
    if (!(far_a > from.radius && far_b > to.radius)) return true; // the light is within one of them
    if (far_a - from.radius > far_b + to.radius) return false;
    const double angle = std::acos(std::clamp(glm::dot(a, b) / (far_a * far_b), -1.0, 1.0));
    return angle < std::asin(from.radius / far_a) + std::asin(to.radius / far_b);
}

// The size of the sphere's outline at the scale that a flat window has at its middle.
double pixels_of(const WorldSphere& sphere, const vdtree::View& view) {
    const double distance = std::max(glm::length(sphere.centre - view.eye), sphere.radius);
    const double focal = view.height / (2 * std::tan(view.fov_y_degrees * std::numbers::pi / 360));
    const double radius = focal * sphere.radius / distance;
    return std::min(std::numbers::pi * radius * radius,
                    static_cast<double>(view.width) * static_cast<double>(view.height));
}

bool same_gaze(const std::optional<Gaze>& a, const std::optional<Gaze>& b) {
    return a.has_value() == b.has_value() && (!a || a->px == b->px);
}

} // namespace

struct LevelControl::Impl {
    struct Subject { // an object and its levels
        const UploadedLevels* levels = nullptr;
        vdtree::Similarity placement;
        WorldSphere sphere;
        int level = 0, drawn_level = -1;
        int fading_from = -1, fade_left = 0;        // level, frames
        bool is_fading = false;                     // in the last frame
        std::optional<vdtree::Lighting> lighting;   // of the last frame
        bool is_known = false;                      // an own test has let it keep a level
        bool is_open = false;                       // a test is on its way
        int refused = most_levels;                  // levels from this one on were too coarse ...
        glm::dvec3 refused_at = glm::dvec3(0);      // ... for an eye here
        std::optional<vdtree::Lighting> refused_in; // ... in this light
        int tests_since = 0;                        // then
        std::uint64_t tested = 0;                   // the last frame whose test let it keep its level
    };
    struct OpenTest {
        std::uint64_t name = 0;
        LevelTest test;
    };
    // What depends on the size of the window, and on the gaze.
    struct Passes {
        int width = 0, height = 0;
        std::optional<Gaze> gaze;
        render::LayerPasses layers;
        render::DifferenceCounts counts;
        std::optional<render::VisibilityPasses> modern;
        std::optional<render::ElevationPasses> rpg99;

        bool have_maps() const { return modern || rpg99; }
        template <class Use> // of one that there is
        auto with_maps(Use use) const {
            return rpg99 ? use(*rpg99) : use(*modern);
        }
    };

    Impl(const render::Context& context_, Session& session_, const LevelControlOptions& options_,
         render::StageTimes times_)
        : context(context_), session(session_.share()), options(options_), uploads(context_), times(std::move(times_)) {
    }

    Result<void> load(const vdtree::View& from, const Request& request) {
        if (auto ready = session.prepare(from, request); !ready) return ready.error();
        const Scene& scene = session.scene();
        for (std::size_t i = 0; i < scene.objects.size(); ++i) {
            const auto levels = uploads.levels(session.tree(i), [&] {
                return options.method == LevelMethod::given ? selection_chain(session, i, options.chain.levels)
                                                            : level_chain(session, from, request, i, options.chain);
            });
            if (!levels) return levels.error();
            Subject& subject = subjects.emplace_back();
            subject.levels = *levels;
            subject.placement = scene.objects[i].placement;
            subject.sphere = world_sphere(scene.objects[i]);
            subject.level = subject.levels->chain.size() - 1;
        }
        for (const Object& part : scene.backdrop) backdrop_spheres.push_back(world_sphere(part));
        return backdrop.load(scene, uploads);
    }

    Result<void> need_passes(const vdtree::View& wanted) {
        const Observer& observer = session.observer();
        if (passes && passes->width == wanted.width && passes->height == wanted.height &&
            same_gaze(passes->gaze, observer.gaze))
            return {};
        // What the GPU cannot draw at all leaves the old ones as they are.
        if (auto current = context.make_current(); !current) return current;
        if (const int most = render::largest_target_side(); wanted.width > most || wanted.height > most)
            return Error{ErrorCode::unsupported, "A picture of " + std::to_string(wanted.width) + "x" +
                                                     std::to_string(wanted.height) +
                                                     " pixels cannot be drawn: this OpenGL can draw at most " +
                                                     std::to_string(most) + " pixels a side; choose a smaller size."};
        passes.reset(); // the old ones first, so that both sizes need not fit at a time
        open.clear();
        for (Subject& subject : subjects) subject.is_open = false;
        auto layers = render::LayerPasses::create(context, wanted.width, wanted.height, options.layers);
        if (!layers) return layers.error();
        auto counts = render::DifferenceCounts::create(context, wanted.width, wanted.height);
        if (!counts) return counts.error();
        Passes made{wanted.width, wanted.height, observer.gaze, std::move(*layers), std::move(*counts), {}, {}};
        const render::Target& combination = made.layers.combination();
        const perception::Display& display = observer.display;
        if (!is_perceptual()) {
            // Nothing is mapped.
        } else if (options.maps == MapRecipe::rpg99) {
            const auto tables = perception::rpg99_tables(
                combination.width(), perception::physical_field(display, combination.width()).value());
            if (!tables) return tables.error();
            auto maps = render::ElevationPasses::create(context, combination.width(), combination.height(), *tables);
            if (!maps) return maps.error();
            made.rpg99 = std::move(*maps);
        } else {
            // Whatever a picture holds: all that the display shows.
            const auto tables = perception::judge_tables(
                combination.width(), combination.height(), static_cast<float>(perception::black_level(display).value()),
                std::nextafter(static_cast<float>(perception::to_luminance(display, 1).value()),
                               std::numeric_limits<float>::infinity()),
                judge_options(observer));
            if (!tables) return tables.error();
            auto maps = render::VisibilityPasses::create(context, *tables, luminance_of(combination));
            if (!maps) return maps.error();
            made.modern = std::move(*maps);
        }
        passes = std::move(made);
        return {};
    }

    Result<void> take_counts(LevelFrame& frame) {
        if (!passes) return {};
        const auto counts = passes->counts.take();
        if (!counts) return counts.error();
        for (const auto& count : *counts) {
            if (open.empty() || open.front().name != count.name) continue; // of passes that are gone
            const OpenTest asked = open.front();
            open.pop_front();
            decide(asked, count.pixels, frame);
        }
        return {};
    }

    void take_times(LevelFrame& frame) {
        for (const std::vector<double>& stages : times.take()) {
            const OpenTimes of = open_times.front();
            open_times.pop_front();
            if (stages.size() != 3 + 2 * of.combinations) continue;
            LevelTimes& t = frame.times.emplace_back();
            t.frame = of.frame;
            t.layers_ms = stages[0];
            for (std::size_t i = 0; i < of.combinations; ++i) {
                t.combinations_ms += stages[1 + 2 * i];
                t.maps_ms += stages[2 + 2 * i];
            }
            t.depth_ms = stages[1 + 2 * of.combinations];
            t.control_ms = stages[2 + 2 * of.combinations];
        }
    }

    void decide(const OpenTest& asked, std::uint64_t pixels, LevelFrame& frame) {
        LevelTest test = asked.test;
        Subject& subject = subjects[test.object];
        subject.is_open = false;
        test.pixels = pixels;
        const double all = static_cast<double>(passes->width) * static_cast<double>(passes->height);
        const double of_object = pixels_of(subject.sphere, view);
        const double upper = options.maps == MapRecipe::rpg99
                                 ? options.upper_share * all
                                 : std::min(options.upper_share * all, options.object_share * of_object);
        const bool is_too_coarse = static_cast<double>(pixels) > upper,
                   could_be_coarser = static_cast<double>(pixels) * options.upper_share < options.lower_share * upper;
        const int worst = subject.levels->chain.size() - 1;
        const bool has_moved =
            glm::length(view.eye - subject.refused_at) > moved_share * glm::length(subject.sphere.centre - view.eye);
        if (has_moved || (++subject.tests_since >= tests_until_retried && subject.refused_in != subject.lighting))
            subject.refused = most_levels;
        if (test.level > 0 && is_too_coarse) {
            test.decision = LevelDecision::better;
            subject.refused = std::min(subject.refused, test.level);
            subject.refused_at = view.eye;
            subject.refused_in = subject.lighting;
            subject.tests_since = 0;
            --subject.level;
        } else {
            subject.is_known = true;
            // The worst one was compared with the next better one: that they look alike lets it stay.
            if (could_be_coarser && test.level < worst && test.level + 1 < subject.refused) {
                test.decision = LevelDecision::worse;
                ++subject.level;
            }
        }
        if (test.decision != LevelDecision::keep) last_change = frames;
        else subject.tested = test.frame;
        frame.tests.push_back(test);
    }

    // l_HQ of the paper: the best level for the first layer, the next one for the second, and so on; better where an object
    // of the layer has reached it.
    int best_of_layer(int layer, const std::vector<std::size_t>& in_sight, const std::vector<int>& layer_of) const {
        int best = layer;
        for (std::size_t i = 0; i < in_sight.size(); ++i)
            if (layer_of[i] == layer) best = std::min(best, subjects[in_sight[i]].level - 1);
        return std::max(best, 0);
    }

    // What a level is held against: one that is better, but that is the next worse one for the best level, to see whether
    // that would do; and the next better one for the worst level. In the beginning the best one.
    int to_compare_with(const Subject& subject, int best) const {
        const int worst = subject.levels->chain.size() - 1;
        if (subject.level == 0) return std::min(1, worst);
        if (!subject.is_known) return 0;
        if (subject.level == worst) return worst - 1;
        return std::min(best, subject.level - 1);
    }

    bool is_due(std::size_t object, int layer) const {
        const Subject& subject = subjects[object];
        if (subject.is_open || subject.is_fading || subject.levels->chain.size() < 2) return false;
        if (tests_all || !subject.is_known) return true;
        const auto period =
            static_cast<std::uint64_t>(options.frames_a_layer) * (static_cast<std::uint64_t>(layer) + 1);
        return (frames + object) % period == 0;
    }

    int chosen_level(const Subject& subject, const vdtree::View& from) const {
        const LevelChain& chain = subject.levels->chain;
        int level = chain.size() - 1;
        if (options.method == LevelMethod::given) return subject.level;
        if (options.method == LevelMethod::distance) {
            const double distance =
                std::max(glm::length(subject.sphere.centre - from.eye) - subject.sphere.radius, 0.0) /
                subject.placement.scale;
            while (level > 0 && !(chain.unseen_from(level) * options.bias <= distance)) --level;
        } else {
            const double triangles = options.bias * pixels_of(subject.sphere, from);
            while (level > 0 && static_cast<double>(chain.triangles(level)) < triangles) --level;
        }
        return level;
    }

    Result<render::Item> item(std::size_t object, int level, const vdtree::View& from) const {
        return lit_item(session, object, subjects[object].levels->cuts[static_cast<std::size_t>(level)], from);
    }

    render::LuminanceTexture luminance_of(const render::Target& target) const {
        const perception::Display& display = session.observer().display;
        const double black = perception::black_level(display).value();
        return {.id = target.colour_texture(),
                .width = target.width(),
                .height = target.height(),
                .channel = 3,
                .scale = static_cast<float>(perception::to_luminance(display, 1).value() - black),
                .offset = static_cast<float>(black)};
    }

    Result<void> map(int left_out) {
        const render::LuminanceTexture picture = luminance_of(passes->layers.combination());
        if (passes->rpg99) return passes->rpg99->map_thresholds(picture, left_out);
        if (auto set = passes->modern->set_reference(picture); !set) return set;
        return passes->modern->map_thresholds(left_out);
    }

    Result<void> combine(int left_out) {
        if (!passes) return no_picture();
        const auto layer = static_cast<std::size_t>(left_out);
        if (!shadows || left_out < 0 || layer >= is_shaded.size() || !is_shaded[layer])
            return passes->layers.combine(left_out);
        std::vector<render::Item> others, of_layer;
        for (std::size_t i = 0; i < casters.size(); ++i)
            (caster_layers[i] == left_out ? of_layer : others).push_back(casters[i]);
        if (std::ranges::none_of(others, is_in_casting_light)) return passes->layers.combine(left_out);
        if (auto drawn = cast(others, other_shadows, of_layer); !drawn) return drawn;
        return passes->layers.combine(left_out, &*other_shadows);
    }

    Result<void> cast(const std::vector<render::Item>& from, std::optional<render::Shadows>& to,
                      const std::optional<std::span<const render::Item>>& receivers = std::nullopt) const {
        if (!to) {
            auto made = render::Shadows::create(context, reach);
            if (!made) return made.error();
            to = std::move(*made);
        }
        return to->update(from, receivers);
    }

    // By layer: whether anything that is not in it may cast a shadow on one of its objects.
    std::vector<char> find_shaded(const render::LayerSplit& split, const std::vector<std::size_t>& in_sight) const {
        std::vector<char> shaded(static_cast<std::size_t>(std::max(split.count, 1)), 0);
        const auto sphere_of_caster = [&](std::size_t i) {
            return i < subjects.size() ? subjects[i].sphere : backdrop_spheres[i - subjects.size()];
        };
        for (std::size_t i = 0; i < in_sight.size(); ++i) {
            const auto layer = static_cast<std::size_t>(split.layer_of[i]);
            const Subject& subject = subjects[in_sight[i]];
            if (shaded[layer] || !subject.lighting) continue;
            for (const Caster& light : casting_lights(session.tree(in_sight[i]), subject.placement, *subject.lighting))
                for (std::size_t from = 0; from < casters.size() && !shaded[layer]; ++from)
                    shaded[layer] = caster_layers[from] != split.layer_of[i] &&
                                    may_shade(light, sphere_of_caster(from), subject.sphere);
        }
        return shaded;
    }

    std::uint64_t shadow_redraws() const {
        return (shadows ? shadows->counts().redraws : 0) + (other_shadows ? other_shadows->counts().redraws : 0);
    }

    Result<LevelFrame> draw(const vdtree::View& from) {
        if (auto valid = vdtree::validate_perspective(from, "A choice of levels"); !valid) return valid.error();
        LevelFrame frame;
        frame.number = frames;
        if (auto taken = take_counts(frame); !taken) return taken.error();
        take_times(frame);
        if (auto made = need_passes(from); !made) return made.error();
        view = from;
        const int maps_before = passes_done();

        Drawing d;
        if (auto done = gather(d, frame); !done) return done.error();
        if (auto done = gather_casters(d); !done) return done.error();
        if (auto done = split(d, frame); !done) return done.error();
        times.begin();
        const std::uint64_t redraws_before = shadow_redraws();
        if (auto done = draw_layers(d, frame); !done) return done.error();
        times.end_stage();
        choose_tests(d, frame);
        const auto combinations = map_layers(d);
        if (!combinations) return combinations.error();
        if (auto done = draw_compared(d, frame); !done) return done.error();
        times.end_stage();
        if (auto done = count_differences(d); !done) return done.error();
        times.end_stage();
        times.end();
        open_times.push_back({frames, *combinations});
        if (auto flushed = context.flush(); !flushed) return flushed.error(); // or counts that are polled never come

        sum_up(frame);
        frame.shadow_passes = static_cast<int>(shadow_redraws() - redraws_before);
        frame.full_screen_passes += passes_done() - maps_before;
        ++frames;
        return frame;
    }

    int passes_done() const {
        return passes->have_maps() ? passes->with_maps([](const auto& maps) { return maps.full_screen_passes(); }) : 0;
    }

    bool is_perceptual() const { return options.method == LevelMethod::perceptual; }

    // A frame on its way: each step of draw() leaves here what the next ones need.
    struct Drawing {
        struct Test {
            std::size_t place = 0; // in `in_sight`
            int compared_with = 0; // level
        };
        std::vector<std::size_t> in_sight;             // objects
        std::vector<render::Item> objects, background; // objects: those in sight
        render::LayerSplit split;                      // of these
        std::vector<std::vector<Test>> tests;          // by layer
        std::vector<render::Item> compared;            // the objects, those that are tested at their other level
    };

    // What is in the window, at its level.
    Result<void> gather(Drawing& d, LevelFrame& frame) {
        frame.levels.assign(subjects.size(), -1);
        frame.tested_with.assign(subjects.size(), -1);
        for (std::size_t i = 0; i < subjects.size(); ++i) {
            Subject& subject = subjects[i];
            if (!is_in_sight(subject.sphere, view)) continue;
            if (!is_perceptual()) subject.level = chosen_level(subject, view);
            auto made = item(i, subject.level, view);
            if (!made) return made.error();
            subject.lighting = made->lighting;
            d.objects.push_back(std::move(*made));
            d.in_sight.push_back(i);
            frame.levels[i] = subject.level;
            const bool has_changed = subject.drawn_level >= 0 && subject.drawn_level != subject.level;
            frame.changed += has_changed;
            if (has_changed && !tests_all)
                subject.fading_from = subject.drawn_level, subject.fade_left = options.fade_frames;
            subject.drawn_level = subject.level;
            frame.triangles += subject.levels->chain.triangles(subject.level);
        }
        auto behind = backdrop.items(session, view);
        if (!behind) return behind.error();
        d.background = std::move(*behind);
        return {};
    }

    // What casts shadows: also what is out of the window, at the level that it would have.
    Result<void> gather_casters(const Drawing& d) {
        casters.clear();
        caster_layers.clear();
        is_shaded.clear();
        if (std::ranges::none_of(d.objects, is_in_casting_light) &&
            std::ranges::none_of(d.background, is_in_casting_light)) {
            shadows.reset();
            other_shadows.reset();
            return {};
        }
        for (std::size_t i = 0; i < subjects.size(); ++i) {
            auto made = item(i, subjects[i].level, view);
            if (!made) return made.error();
            casters.push_back(std::move(*made));
        }
        casters.insert(casters.end(), d.background.begin(), d.background.end());
        if (!reach) reach = render::ball_around(casters);
        return {};
    }

    Result<void> split(Drawing& d, LevelFrame& frame) const {
        std::vector<glm::dvec3> centres;
        for (const std::size_t i : d.in_sight) centres.push_back(subjects[i].sphere.centre);
        auto made = render::split_into_layers(centres, view, options.layers);
        if (!made) return made.error();
        d.split = std::move(*made);
        if (!is_perceptual()) d.split = {.layer_of = std::vector<int>(d.objects.size(), 0), .count = 0, .borders = {}};
        frame.layers = d.split.count;
        return {};
    }

    // Those that fade are drawn at both levels.
    void fade(const Drawing& d, std::vector<render::Item>& shown, std::vector<int>& layer_of, LevelFrame& frame) {
        for (std::size_t i = 0; i < d.in_sight.size(); ++i) {
            Subject& subject = subjects[d.in_sight[i]];
            subject.is_fading = subject.fade_left > 0;
            if (!subject.is_fading) continue;
            const float share = 1 - static_cast<float>(subject.fade_left) / static_cast<float>(options.fade_frames + 1);
            --subject.fade_left;
            shown[i].stipple = {0, share};
            render::Item before = d.objects[i];
            before.cut = subject.levels->cuts[static_cast<std::size_t>(subject.fading_from)];
            before.stipple = {share, 1};
            shown.push_back(std::move(before));
            layer_of.push_back(d.split.layer_of[i]);
            frame.triangles += subject.levels->chain.triangles(subject.fading_from);
        }
    }

    Result<void> draw_layers(const Drawing& d, LevelFrame& frame) {
        std::vector<render::Item> shown = d.objects;
        render::LayerSplit split_of_shown = d.split;
        fade(d, shown, split_of_shown.layer_of, frame);
        if (!casters.empty()) {
            caster_layers.assign(casters.size(), -1);
            for (std::size_t i = 0; i < d.in_sight.size(); ++i) caster_layers[d.in_sight[i]] = d.split.layer_of[i];
            if (is_perceptual()) is_shaded = find_shaded(d.split, d.in_sight);
            if (auto drawn = cast(casters, shadows); !drawn) return drawn.error();
            frame.shadow_maps = shadows->counts().maps;
        }
        return passes->layers.draw(shown, d.background, {.view = view, .shadows = shadows ? &*shadows : nullptr},
                                   split_of_shown, glm::vec4(session.background()));
    }

    // Which objects are tested, and against which level.
    void choose_tests(Drawing& d, LevelFrame& frame) const {
        d.tests.resize(static_cast<std::size_t>(passes->layers.combination_count()));
        for (std::size_t layer = 0; is_perceptual() && layer < d.tests.size(); ++layer) {
            const int number = static_cast<int>(layer), best = best_of_layer(number, d.in_sight, d.split.layer_of);
            for (std::size_t i = 0; i < d.in_sight.size(); ++i) {
                const std::size_t object = d.in_sight[i];
                if (d.split.layer_of[i] != number || !is_due(object, number)) continue;
                const int compared_with = to_compare_with(subjects[object], best);
                if (compared_with == subjects[object].level) continue; // a chain of one level
                d.tests[layer].push_back({i, compared_with});
                frame.tested_with[object] = compared_with;
            }
        }
    }

    // What all other layers show together, and which steps of luminance go unseen in it. Returns for how many layers.
    Result<std::size_t> map_layers(const Drawing& d) {
        std::size_t combinations = 0;
        for (std::size_t layer = 0; is_perceptual() && layer < d.tests.size(); ++layer) {
            if (d.tests[layer].empty()) continue;
            const int number = static_cast<int>(layer);
            if (auto combined = combine(number); !combined) return combined.error();
            times.end_stage();
            if (auto mapped = map(number); !mapped) return mapped.error();
            times.end_stage();
            ++combinations;
        }
        return combinations;
    }

    // The depth of what is tested as it will be drawn once more, and of all else at its coarsest.
    Result<void> draw_compared(Drawing& d, LevelFrame& frame) {
        d.compared = d.objects;
        if (std::ranges::all_of(d.tests, [](const auto& of_layer) { return of_layer.empty(); })) return {};
        for (std::size_t i = 0; i < d.in_sight.size(); ++i) {
            const auto& cuts = subjects[d.in_sight[i]].levels->cuts;
            const int with = frame.tested_with[d.in_sight[i]];
            d.compared[i].cut = with < 0 ? cuts.back() : cuts[static_cast<std::size_t>(with)];
        }
        std::vector<render::Item> all = d.compared;
        all.insert(all.end(), d.background.begin(), d.background.end());
        // Shadows are those of the better levels as well, or what a better level's surface has of a worse one's shadow on
        // itself would count. All else casts its own.
        if (!casters.empty()) {
            std::vector<render::Item> better = casters, receivers;
            for (std::size_t i = 0; i < d.in_sight.size(); ++i) {
                if (frame.tested_with[d.in_sight[i]] < 0) continue;
                better[d.in_sight[i]].cut = d.compared[i].cut;
                receivers.push_back(d.compared[i]);
            }
            if (auto drawn = cast(better, other_shadows, receivers); !drawn) return drawn.error();
        }
        ++frame.surface_passes;
        return passes->counts.draw_depth(all, {.view = view,
                                               .near_plane = passes->layers.near_plane(),
                                               .shadows = casters.empty() ? nullptr : &*other_shadows});
    }

    // Draws what is tested once more, and lets the GPU count what is seen of the difference.
    Result<void> count_differences(const Drawing& d) {
        for (std::size_t layer = 0; layer < d.tests.size(); ++layer)
            for (const Drawing::Test& test : d.tests[layer]) {
                const std::size_t object = d.in_sight[test.place];
                const unsigned map = passes->with_maps(
                    [&](const auto& maps) { return maps.thresholds_texture(static_cast<int>(layer)); });
                const auto name =
                    passes->counts.begin(d.compared[test.place], luminance_of(passes->layers.composite()), map);
                if (!name) return name.error();
                OpenTest& asked = open.emplace_back();
                asked.name = *name;
                asked.test = {.frame = frames,
                              .object = object,
                              .level = subjects[object].level,
                              .compared_with = test.compared_with};
                subjects[object].is_open = true;
            }
        return {};
    }

    void sum_up(LevelFrame& frame) const {
        const render::LayerCounts counts = passes->layers.counts();
        frame.surface_passes += counts.surface_passes;
        frame.masked_layers = counts.mask_passes;
        frame.full_screen_passes = counts.full_screen_passes;
        const std::uint64_t of_maps =
            passes->have_maps() ? passes->with_maps([](const auto& maps) { return maps.texture_bytes(); }) : 0;
        frame.texture_bytes = counts.texture_bytes + of_maps +
                              4 * static_cast<std::uint64_t>(view.width) * static_cast<std::uint64_t>(view.height) +
                              (shadows ? shadows->counts().bytes : 0) +
                              (other_shadows ? other_shadows->counts().bytes : 0);
    }

    render::Context context;
    Session session;
    LevelControlOptions options;
    SharedUploads uploads;
    std::vector<Subject> subjects;
    UploadedBackdrop backdrop;
    std::vector<WorldSphere> backdrop_spheres;
    std::optional<render::Ball> reach; // of shadows: around all that there is
    // Shadows of the picture; and, one after the other, those that mask a layer and those that what is tested casts.
    // Made when they are first drawn.
    std::optional<render::Shadows> shadows, other_shadows;
    // From the last frame: what casts shadows, first the objects, and the layer that each is in, or -1; and by layer
    // whether any may fall on it from elsewhere.
    std::vector<render::Item> casters;
    std::vector<int> caster_layers;
    std::vector<char> is_shaded;
    std::optional<Passes> passes;
    render::StageTimes times;
    struct OpenTimes {
        std::uint64_t frame = 0;
        std::size_t combinations = 0;
    };
    std::deque<OpenTimes> open_times;
    std::deque<OpenTest> open;
    std::uint64_t frames = 0, last_change = 0;
    bool tests_all = false;
    vdtree::View view;
};

Result<LevelControl> LevelControl::create(const render::Context& context, Session& session, const vdtree::View& view,
                                          const LevelControlOptions& options, Request request) {
    if (auto valid = check(options); !valid) return valid.error();
    request.goal = Goal::imperceptible();
    auto times = render::StageTimes::create(context);
    if (!times) return times.error();
    auto impl = std::make_unique<Impl>(context, session, options, std::move(*times));
    if (auto loaded = impl->load(view, request); !loaded) return loaded.error();
    if (auto made = impl->need_passes(view); !made) return made.error();
    return LevelControl(std::move(impl));
}

Result<LevelFrame> LevelControl::draw(const vdtree::View& view) { return impl_->draw(view); }

void LevelControl::set_bias(double bias) {
    assert(bias > 0 && std::isfinite(bias));
    impl_->options.bias = bias;
}

void LevelControl::set_levels(std::span<const int> levels) {
    Impl& own = *impl_;
    assert(own.options.method == LevelMethod::given && levels.size() == own.subjects.size());
    for (std::size_t i = 0; i < levels.size(); ++i) {
        const int last = own.subjects[i].levels->chain.size() - 1;
        own.subjects[i].level = levels[i] < 0 ? last : std::min(levels[i], last);
    }
}

bool LevelControl::is_settled() const noexcept {
    const Impl& own = *impl_;
    if (own.options.method != LevelMethod::perceptual) return own.frames > 0;
    if (own.frames == 0) return false;
    return std::ranges::all_of(own.subjects, [&](const Impl::Subject& subject) {
        return subject.levels->chain.size() < 2 || !is_in_sight(subject.sphere, own.view) ||
               (subject.is_known && subject.tested >= own.last_change);
    });
}

Result<LevelFrame> LevelControl::wait() {
    if (auto done = impl_->context.finish(); !done) return done.error();
    LevelFrame known;
    if (auto taken = impl_->take_counts(known); !taken) return taken.error();
    impl_->take_times(known);
    return known;
}

Result<LevelFrame> LevelControl::settle(const vdtree::View& view, int most_frames) {
    std::vector<LevelTest> tests;
    std::vector<LevelTimes> times;
    const auto keep = [&](const LevelFrame& known) {
        tests.insert(tests.end(), known.tests.begin(), known.tests.end());
        times.insert(times.end(), known.times.begin(), known.times.end());
    };
    Impl& own = *impl_;
    own.tests_all = true;
    Result<LevelFrame> frame = LevelFrame{};
    for (int i = 0; i < std::max(most_frames, 1); ++i) {
        frame = own.draw(view);
        if (!frame) break;
        keep(*frame);
        // Its counts come before the next one: the picture shows what they leave as it is.
        const auto known = wait();
        if (!known) {
            frame = known.error();
            break;
        }
        keep(*known);
        if (is_settled()) break;
    }
    own.tests_all = false;
    if (!frame) return frame;
    frame->tests = std::move(tests);
    frame->times = std::move(times);
    return frame;
}

// Draws only the depth of each level's objects: a pixel shows the nearest level.
Result<std::vector<int>> LevelControl::read_levels() {
    Impl& own = *impl_;
    if (!own.passes) return no_picture();
    auto target =
        render::Target::create(own.context, own.passes->width, own.passes->height, {.colours = {}, .label = "levels"});
    if (!target) return target.error();
    const auto pixels = static_cast<std::size_t>(target->width()) * static_cast<std::size_t>(target->height());
    std::vector<int> levels(pixels, -1);
    std::vector<float> nearest(pixels, 0);
    for (int level = -1; level < most_levels; ++level) {
        std::vector<render::Item> items;
        if (level < 0) {
            auto behind = own.backdrop.items(own.session, own.view);
            if (!behind) return behind.error();
            items = std::move(*behind);
        }
        for (const Impl::Subject& subject : own.subjects)
            if (level >= 0 && subject.drawn_level == level && is_in_sight(subject.sphere, own.view))
                items.push_back({subject.levels->cuts[static_cast<std::size_t>(level)], subject.placement});
        if (items.empty()) continue;
        if (auto drawn = render::draw(items, {.view = own.view, .near_plane = own.passes->layers.near_plane()}, *target,
                                      {.colour = std::nullopt});
            !drawn)
            return drawn.error();
        const auto depth = render::read_depth(*target);
        if (!depth) return depth.error();
        for (std::size_t i = 0; i < pixels; ++i)
            if ((*depth)[i] > nearest[i]) nearest[i] = (*depth)[i], levels[i] = level;
    }
    return levels;
}

const render::Target& LevelControl::picture() const noexcept { return impl_->passes->layers.composite(); }
const render::LayerPasses& LevelControl::layers() const noexcept { return impl_->passes->layers; }

Result<std::vector<float>> LevelControl::thresholds(int left_out) {
    Impl& own = *impl_;
    if (!own.passes) return no_picture();
    if (!own.passes->have_maps()) return bad_option("only the method perceptual has maps of thresholds");
    if (auto combined = own.combine(left_out); !combined) return combined.error();
    if (auto mapped = own.map(left_out); !mapped) return mapped.error();
    return own.passes->with_maps([&](const auto& maps) { return maps.read_thresholds(left_out); });
}

int LevelControl::map_width() const noexcept { return impl_->passes->layers.combination().width(); }
int LevelControl::map_height() const noexcept { return impl_->passes->layers.combination().height(); }

const LevelChain& LevelControl::chain(std::size_t object) const noexcept {
    return impl_->subjects[object].levels->chain;
}

} // namespace unseen::session
