#include <unseen/session_gpu/lod.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <numbers>
#include <random>

#include <glm/geometric.hpp>

#include <unseen/session_gpu/tradeoff.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/number_format.h>

namespace unseen::session {
namespace {

constexpr int most_directions = 1000, most_lod_samples = 256;
constexpr int quick_samples = 16;                       // tell nothing from nothing most of the time
constexpr int most_growths = 25;                        // a hundred times as far: what shows there has another cause
constexpr std::array lod_approaches = {1.44, 1.2, 1.1}; // times nearer, one after the other
constexpr int approach_directions = 4;
constexpr int margin_px = 32; // around the outline: what the judges look at beside a pixel

double focal_px(const Lod& lod) { return lod.height_px / 2.0 / std::tan(lod.fov_y_degrees * std::numbers::pi / 360); }

// The radius of the sphere's outline, seen straight ahead. Precondition: the eye is outside.
double outline_px(const Lod& lod, double radius, double distance) {
    return focal_px(lod) * radius / std::sqrt((distance - radius) * (distance + radius));
}

// Where the outline, with its margin, just fits.
double nearest_distance(const Lod& lod, double radius) {
    const double room = std::max(1.0, std::min(lod.width_px, lod.height_px) / 2.0 - margin_px);
    return radius * std::hypot(1.0, focal_px(lod) / room);
}

double coverage_of(const Lod& lod, double radius, double distance) {
    const double outline = outline_px(lod, radius, distance);
    return std::min(1.0, std::numbers::pi * outline * outline /
                             (static_cast<double>(lod.width_px) * static_cast<double>(lod.height_px)));
}

Result<void> check(const LodOptions& options, const perception::Display& display) {
    if (options.directions < 1 || options.directions > most_directions)
        return invalid_field("{lod.directions} must be 1 to {}, not {}.",
                             {std::to_string(most_directions), std::to_string(options.directions)});
    if (options.samples < 1 || options.samples > most_lod_samples)
        return invalid_field("{lod.samples} must be 1 to {}, not {}.",
                             {std::to_string(most_lod_samples), std::to_string(options.samples)});
    if (!(options.cost > 0 && std::isfinite(options.cost)))
        return invalid_field("{lod.cost} must be above 0 and finite.");
    if (options.fov_y_degrees && !(*options.fov_y_degrees > 0 && *options.fov_y_degrees < 180))
        return invalid_field("{lod.fov_y_degrees} must lie between 0 and 180.");
    constexpr int least_px = 4 * margin_px;
    if (std::min(display.width_px, display.height_px) < least_px)
        return invalid_argument("Levels of detail need a display of " + std::to_string(least_px) +
                                " pixels a side or more.");
    return {};
}

Result<Session> alone(const Session& session, std::size_t object) {
    const Scene& all = session.scene();
    const Object& source = all.objects[object];
    Scene scene;
    scene.objects.push_back({.tree = session.tree(object).share(),
                             .placement = source.placement,
                             .name = source.name,
                             .texture_left_out = source.texture_left_out,
                             .is_relit = source.is_relit,
                             .origin = source.origin,
                             .measurement = source.measurement});
    scene.background = all.background;
    scene.lights = all.lights;
    Observer observer = session.observer();
    observer.gaze.reset(); // levels are for eyes that look anywhere
    return Session::create(std::move(scene), std::move(observer));
}

// Makes the levels of one object, alone.
class ObjectLevels {
public:
    ObjectLevels(Session& session, const render::Context& context, const LodOptions& options, Lod& lod,
                 std::function<bool(double)> goes_on)
        : session_(session), context_(context), options_(options), lod_(lod), goes_on_(std::move(goes_on)) {}

    Result<LodObject> make() {
        const Object& object = session_.scene().objects[0];
        vdtree::View window;
        window.width = lod_.width_px, window.height = lod_.height_px, window.fov_y_degrees = lod_.fov_y_degrees;
        auto chain =
            level_chain(session_, session_.frame({0, 0, 1}, 0.9, window), {.reasons = false}, 0, options_.chain);
        if (!chain) return chain.error();
        LodObject made{.name = object.name, .sphere = world_sphere(object), .chain = std::move(*chain), .levels = {}};
        made.levels.push_back({.triangles = made.chain.triangles(0)});
        scale_ = object.placement.scale;
        std::vector<LodLevel> open = candidates(made);
        merge(open, made);
        if (!open.empty()) {
            auto renderer = SceneRenderer::create(context_, session_);
            if (!renderer) return renderer.error();
            renderer_ = std::make_shared<SceneRenderer>(std::move(*renderer));
        }
        std::vector<LodLevel> seen_through;
        for (std::size_t i = 0; i < open.size(); ++i) {
            first_share_ = static_cast<double>(i) / static_cast<double>(open.size());
            step_ = 1.0 / static_cast<double>(open.size());
            const auto settled = settle(made, open[i]);
            if (!settled) return settled.error();
            if (*settled) seen_through.push_back(std::move(open[i]));
            else
                made.notes.push_back("a level of " + std::to_string(open[i].triangles) +
                                     " triangles shows from anywhere, and was left out.");
        }
        merge(seen_through, made);
        for (LodLevel& level : seen_through) {
            level.coverage = coverage_of(lod_, made.sphere.radius, level.distance);
            const vdtree::Cut cut = made.chain.cut(level.chain_level);
            level.shift = largest_shift(session_, {&cut, 1});
            level.pixel_error = level.shift * focal_px(lod_) / (level.distance - made.sphere.radius);
            made.levels.push_back(std::move(level));
        }
        if (made.levels.size() == 1)
            made.notes.push_back("it has no level below the full mesh that nobody sees from anywhere.");
        return made;
    }

private:
    std::vector<LodLevel> candidates(LodObject& made) const {
        std::vector<LodLevel> open;
        for (int level = 1; level < made.chain.size(); ++level) {
            const double promised = made.chain.unseen_from(level) / options_.cost * scale_ + made.sphere.radius;
            if (!std::isfinite(promised)) {
                made.notes.push_back("a level of " + std::to_string(made.chain.triangles(level)) +
                                     " triangles is seen from everywhere, and was left out.");
                continue;
            }
            open.push_back({.chain_level = level,
                            .triangles = made.chain.triangles(level),
                            .distance = std::max(promised, nearest_distance(lod_, made.sphere.radius)),
                            .promised_distance = promised});
        }
        return open;
    }

    // When levels begin at about one distance, only the last stays.
    static void merge(std::vector<LodLevel>& levels, LodObject& made) {
        for (std::size_t i = levels.size(); i-- > 1;) {
            if (levels[i].distance >= lod_step * levels[i - 1].distance) continue;
            made.notes.push_back("the level of " + std::to_string(levels[i - 1].triangles) +
                                 " triangles was merged with that of " + std::to_string(levels[i].triangles) +
                                 ", which nobody can tell from it where it would begin.");
            levels.erase(levels.begin() + static_cast<std::ptrdiff_t>(i) - 1);
        }
    }

    // Whether there is a distance. The level has it, then, with its checks.
    Result<bool> settle(const LodObject& made, LodLevel& level) {
        std::vector<vdtree::Cut> cuts;
        cuts.push_back(made.chain.cut(level.chain_level));
        if (auto near = approach(made, level, cuts); !near) return near.error();
        for (int growth = 0; growth <= most_growths; ++growth) {
            const auto shows = look(made, level, cuts, growth);
            if (!shows) return shows.error();
            if (!*shows) return true;
            level.distance *= lod_growth;
        }
        return false;
    }

    // Brings the level as near as nothing shows from a few sides: the fold test promises for the worst of all.
    Result<void> approach(const LodObject& made, LodLevel& level, const std::vector<vdtree::Cut>& cuts) {
        const double nearest = nearest_distance(lod_, made.sphere.radius);
        int step = 0;
        for (const double approach : lod_approaches)
            for (bool is_unseen = true; is_unseen && level.distance > nearest; ++step) {
                const double nearer = std::max(level.distance / approach, nearest);
                for (const glm::dvec3& direction : lod_directions(approach_directions, seed_of(level, -1 - step))) {
                    if (auto told = tell(0); !told) return told;
                    const auto verdict = look_from(made, direction, nearer, cuts);
                    if (!verdict) return verdict.error();
                    is_unseen = passes(*verdict);
                    if (!is_unseen) break;
                }
                if (is_unseen) level.distance = nearer;
            }
        return {};
    }

    // Other sides for each level and each distance: none that was decided by is reported.
    std::uint64_t seed_of(const LodLevel& level, int growth) const {
        return options_.seed * 1'000'003 + static_cast<std::uint64_t>(level.chain_level) * 1009 +
               static_cast<std::uint64_t>(growth + most_growths);
    }
    Result<void> tell(double share_of_level) {
        if (!goes_on_ || goes_on_(first_share_ + step_ * share_of_level)) return {};
        return Error{ErrorCode::cancelled, "Making levels of detail was stopped."};
    }

    Result<bool> look(const LodObject& made, LodLevel& level, const std::vector<vdtree::Cut>& cuts, int growth) {
        level.checks.clear();
        for (const glm::dvec3& direction : lod_directions(options_.directions, seed_of(level, growth))) {
            const double share = static_cast<double>(level.checks.size()) / options_.directions;
            if (auto told = tell(share); !told) return told.error();
            const auto verdict = look_from(made, direction, level.distance, cuts);
            if (!verdict) return verdict.error();
            level.checks.push_back({*verdict, direction});
            if (!passes(*verdict)) return true;
        }
        return false;
    }

    bool passes(const PictureVerdict& verdict) const {
        if (options_.cost <= 1 && !verdict.shows_nothing()) return false;
        return std::max(verdict.v, verdict.second_v) <= lod_most * std::max(options_.cost, 1.0);
    }

    // With few samples where these show nothing.
    Result<PictureVerdict> look_from(const LodObject& made, const glm::dvec3& direction, double distance,
                                     const std::vector<vdtree::Cut>& cuts) {
        const vdtree::View view = lod_view(lod_, made.sphere, direction, distance);
        PictureVerdict verdict;
        for (const int samples : {std::min(quick_samples, options_.samples), options_.samples}) {
            auto judge = PictureJudge::create(renderer_, session_, view, samples);
            if (!judge) return judge.error();
            const auto judged = judge->judge(cuts);
            if (!judged) return judged.error();
            verdict = *judged;
            ++lod_.looks;
            if (passes(verdict)) break;
        }
        return verdict;
    }

    Session& session_;
    const render::Context& context_;
    const LodOptions& options_;
    Lod& lod_;
    std::function<bool(double)> goes_on_;
    std::shared_ptr<SceneRenderer> renderer_;
    double scale_ = 1;                  // world units a mesh unit
    double first_share_ = 0, step_ = 1; // of the progress, of the level at hand
};

} // namespace

double height_px(const Lod& lod, const LodLevel& level) {
    return 2 * std::sqrt(level.coverage * lod.width_px * lod.height_px / std::numbers::pi);
}

vdtree::View lod_view(const Lod& lod, const WorldSphere& sphere, glm::dvec3 direction, double distance) {
    const double outline = outline_px(lod, sphere.radius, distance);
    constexpr int step = 16; // so that sizes repeat
    const int wanted = 2 * (static_cast<int>(std::ceil(outline)) + margin_px);
    const int side = std::min((wanted + step - 1) / step * step, std::min(lod.width_px, lod.height_px));
    vdtree::View view;
    view.width = view.height = side;
    view.fov_y_degrees = 360 / std::numbers::pi * std::atan(side / 2.0 / focal_px(lod));
    view.target = sphere.centre;
    view.eye = sphere.centre + distance * direction;
    return view;
}

std::vector<glm::dvec3> lod_directions(int count, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    // What the standard's distributions make of the bits is up to the library.
    const auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
    const double off_axis = std::cos(5 * std::numbers::pi / 180);
    std::vector<glm::dvec3> directions;
    while (directions.size() < static_cast<std::size_t>(count)) {
        // One in each of as many bands of equal area, so that no side is left out; none at the poles.
        const double z = off_axis * (1 - 2 * (static_cast<double>(directions.size()) + uniform()) / count);
        const double turn = 2 * std::numbers::pi * uniform(), across = std::sqrt(std::max(0.0, 1 - z * z));
        const glm::dvec3 direction(across * std::cos(turn), z, across * std::sin(turn));
        const double along = std::max(std::abs(direction.x), std::abs(direction.z));
        if (along < off_axis) directions.push_back(direction);
    }
    return directions;
}

Result<Lod> make_levels(Session& session, const render::Context& context, const LodOptions& options) {
    const perception::Display& display = session.observer().display;
    if (auto valid = check(options, display); !valid) return valid.error();
    Lod lod;
    lod.width_px = display.width_px, lod.height_px = display.height_px;
    lod.fov_y_degrees = options.fov_y_degrees.value_or(perception::physical_field(display, display.height_px).value());
    lod.directions = options.directions, lod.samples = options.samples;
    lod.cost = options.cost;
    if (auto ready = session.prepare(session.default_view(), {.reasons = false}); !ready) return ready.error();
    const std::size_t count = session.scene().objects.size();
    // Under lights the same object looks different elsewhere.
    std::map<std::pair<const vdtree::VertexTree::Data*, double>, std::size_t> known;
    for (std::size_t i = 0; i < count; ++i) {
        const Object& object = session.scene().objects[i];
        const auto [first, is_new] = known.try_emplace({&session.tree(i).data(), object.placement.scale}, i);
        if (!is_new && !session.scene().lights) {
            LodObject copy = lod.objects[first->second];
            copy.name = object.name, copy.object = i, copy.sphere = world_sphere(object);
            lod.objects.push_back(std::move(copy));
            continue;
        }
        auto single = alone(session, i);
        if (!single) return single.error();
        ObjectLevels levels(*single, context, options, lod, [&](double share) {
            return !options.progress ||
                   options.progress((static_cast<double>(i) + share) / static_cast<double>(count), "levels");
        });
        auto made = levels.make();
        if (!made) return made.error();
        made->object = made->same_as = i;
        lod.objects.push_back(std::move(*made));
    }
    return lod;
}

Result<meshio::LevelsWritten> write_levels(const std::filesystem::path& file, const Scene& scene, const Lod& lod,
                                           const meshio::GltfOptions& options, std::optional<std::size_t> only) {
    std::deque<vdtree::Cut> cuts;
    std::vector<meshio::LevelCuts> all;
    std::map<std::pair<std::size_t, std::size_t>, const vdtree::Cut*> known; // by object and level
    for (const LodObject& object : lod.objects) {
        meshio::LevelCuts& levels = all.emplace_back();
        levels.node = scene.objects[object.object].node, levels.mesh = scene.objects[object.object].mesh;
        const std::size_t last = object.levels.size() - 1;
        const std::size_t from = only ? std::min(*only, last) : 0, to = only ? from : last;
        for (std::size_t level = from; level <= to; ++level) {
            const vdtree::Cut*& cut = known[{object.same_as, level}];
            if (!cut) cut = &cuts.emplace_back(object.cut(level));
            levels.cuts.push_back(cut);
            // A level ends where the next one begins.
            levels.coverages.push_back(level < to ? object.levels[level + 1].coverage : 0);
        }
    }
    for (const Object& part : scene.backdrop) {
        cuts.emplace_back(part.tree).unfold_all();
        all.push_back({part.node, part.mesh, {&cuts.back()}, {0}});
    }
    if (scene.source) return meshio::write_scene(file, *scene.source, all, options);
    if (all.size() == 1) return meshio::write_model_levels(file, all[0], options);
    return invalid_argument("Cannot write '" + file.string() +
                            "': scenes of several objects are written only where a glTF file is their source.");
}

} // namespace unseen::session
