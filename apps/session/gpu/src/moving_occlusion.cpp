#include <unseen/session_gpu/moving_occlusion.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <future>
#include <numbers>
#include <optional>
#include <string>

#include <glm/geometric.hpp>

#include <unseen/render/depth_cells.h>
#include <unseen/session_gpu/trial.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/number_format.h>
#include <unseen/vdtree/internal/stopwatch.h>

namespace unseen::session {
namespace {

// The eye may get faster by so much while a picture serves, and leave its way by so much of that.
constexpr double faster = 1.5, aside = 0.2;
// Share of the scene's radius: eyes that stand nearly still do not call for a picture each time they begin to move.
constexpr double least_reach = 0.002;
// Of the reach, and of the field: when the next picture is due.
constexpr double used_up = 0.5, turned_away = 0.1;

glm::dvec3 forward(const vdtree::View& view) { return -vdtree::camera_frame(view).back; }

} // namespace

struct MovingOcclusion::Impl {
    Impl(const render::Context& context_, const Session& session_, const MovingOcclusionOptions& options_)
        : context(context_), session(session_), options(options_) {}
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;
    ~Impl() {
        if (looking.valid()) looking.wait();
    }

    bool is_on() const { return options.use == MovingOcclusionOptions::Use::always || trial.is_on(); }
    Result<void> look_for_cells();
    Result<void> look_for_nodes();
    bool is_due(const vdtree::View& view) const;
    template <class Begin> // begin(reader)
    Result<void> end_frame(const vdtree::View& view, double frame_ms, Begin&& begin);
    template <class Begin>
    Result<void> begin_picture(const vdtree::View& view, Begin&& begin);
    void see_motion(const vdtree::View& view);

    const render::Context& context;
    const Session& session;
    MovingOcclusionOptions options;
    Trial trial;
    std::optional<render::DepthCellReader> reader; // made when the first picture is due
    // The picture that is under way, and what its cells turn out to hide.
    vdtree::View pictured;
    vdtree::EyeReach reach;
    std::future<Result<HiddenNodes>> looking;
    std::shared_ptr<const HiddenNodes> known;

    std::optional<vdtree::View> before;  // the last frame's
    glm::dvec3 velocity = glm::dvec3(0); // world units a frame
    Facts facts;
    double frame_extra_ms = 0;
};

Result<MovingOcclusion> MovingOcclusion::create(const render::Context& context, const Session& session,
                                                const MovingOcclusionOptions& options) {
    constexpr int most_samples = 256, largest_cell = 64;
    if (options.samples < 1 || options.samples > most_samples)
        return invalid_argument("Occlusion needs 1 to 256 samples a pixel, not " + std::to_string(options.samples) +
                                ".");
    if (options.cell_px < 1 || options.cell_px > largest_cell)
        return invalid_argument("Occlusion needs cells of 1 to 64 pixels a side, not " +
                                std::to_string(options.cell_px) + ".");
    if (options.frames < 1) return invalid_argument("An occlusion picture must serve a frame or more.");
    return MovingOcclusion(std::make_unique<Impl>(context, session, options));
}

MovingOcclusion::MovingOcclusion(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
MovingOcclusion::MovingOcclusion(MovingOcclusion&&) noexcept = default;
MovingOcclusion& MovingOcclusion::operator=(MovingOcclusion&&) noexcept = default;
MovingOcclusion::~MovingOcclusion() = default;

// The GPU is through with the picture: what it hides is looked for.
Result<void> MovingOcclusion::Impl::look_for_cells() {
    if (!reader || !reader->is_under_way() || looking.valid()) return {};
    auto cells = reader->take(options.waits);
    if (!cells) return cells.error();
    if (!*cells) return {};
    auto map = vdtree::OcclusionMap::create(pictured, std::move(**cells), reach);
    if (!map) return map.error();
    auto look = [objects = placed_trees(session), map = std::move(*map)]() mutable {
        return HiddenNodes::find(objects, std::move(map));
    };
    looking = std::async(options.waits ? std::launch::deferred : std::launch::async, std::move(look));
    return {};
}

Result<void> MovingOcclusion::Impl::look_for_nodes() {
    if (!looking.valid()) return {};
    if (!options.waits && looking.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return {};
    auto found = looking.get();
    if (!found) return found.error();
    known = std::make_shared<const HiddenNodes>(std::move(*found));
    facts.objects = known->touched();
    return {};
}

Result<std::shared_ptr<const HiddenNodes>> MovingOcclusion::begin_frame(const vdtree::View& view) {
    Impl& impl = *impl_;
    const auto start = vdtree::Clock::now();
    if (const auto looked = impl.look_for_cells(); !looked) return looked.error();
    if (const auto looked = impl.look_for_nodes(); !looked) return looked.error();
    impl.frame_extra_ms = vdtree::ms_since(start);
    if (!impl.is_on() || !impl.known || !impl.known->holds_for(view.eye)) return std::shared_ptr<const HiddenNodes>();
    return impl.known;
}

void MovingOcclusion::Impl::see_motion(const vdtree::View& view) {
    if (before) velocity = view.eye - before->eye;
    before = view;
}

bool MovingOcclusion::Impl::is_due(const vdtree::View& view) const {
    if ((reader && reader->is_under_way()) || looking.valid()) return false;
    if (!known) return true;
    const vdtree::View& of = known->map().view();
    if (of.width != view.width || of.height != view.height || of.fov_y_degrees != view.fov_y_degrees ||
        of.shift != view.shift)
        return true;
    const vdtree::EyeReach& reaches = known->map().reach();
    if (!(glm::length(view.eye - of.eye) <= used_up * (glm::length(reaches.along) + reaches.around))) return true;
    const double turn = std::acos(std::clamp(glm::dot(forward(of), forward(view)), -1.0, 1.0));
    return turn > (std::numbers::pi / 180) * turned_away * view.fov_y_degrees;
}

template <class Begin>
Result<void> MovingOcclusion::Impl::begin_picture(const vdtree::View& view, Begin&& begin) {
    if (!reader || pictured.width != view.width || pictured.height != view.height) {
        auto made = render::DepthCellReader::create(context, view.width, view.height, options.cell_px);
        if (!made) return made.error();
        reader = std::move(*made);
    }
    if (auto begun = begin(*reader); !begun) return begun;
    facts.bytes = reader->byte_size();
    pictured = view;
    reach.along = faster * options.frames * velocity;
    reach.around =
        std::max(aside * options.frames * glm::length(velocity), least_reach * session.bounding_sphere().radius);
    ++facts.pictures;
    return {};
}

template <class Begin>
Result<void> MovingOcclusion::Impl::end_frame(const vdtree::View& view, double frame_ms, Begin&& begin) {
    const auto start = vdtree::Clock::now();
    const bool was_on = is_on();
    see_motion(view);
    if (was_on && is_due(view))
        if (auto begun = begin_picture(view, begin); !begun) return begun;
    const double after_ms = vdtree::ms_since(start);
    ++facts.frames;
    facts.frames_on += was_on;
    facts.is_on = was_on;
    facts.milliseconds += frame_extra_ms + after_ms;
    if (options.use == MovingOcclusionOptions::Use::where_it_saves_time) trial.add(frame_ms + after_ms);
    return {};
}

Result<void> MovingOcclusion::end_frame(const render::DrawnDepth& shown, const vdtree::View& view, double frame_ms) {
    return impl_->end_frame(view, frame_ms, [&](render::DepthCellReader& reader) { return reader.begin(shown); });
}

Result<void> MovingOcclusion::end_frame(const SceneItems& shown, const vdtree::View& view, double frame_ms) {
    return impl_->end_frame(view, frame_ms, [&](render::DepthCellReader& reader) {
        impl_->facts.drawings += static_cast<std::size_t>(impl_->options.samples);
        return reader.begin(shown.items, view, impl_->options.samples);
    });
}

MovingOcclusion::Facts MovingOcclusion::facts() const {
    Facts facts = impl_->facts;
    facts.with_ms = impl_->trial.milliseconds(true);
    facts.without_ms = impl_->trial.milliseconds(false);
    facts.tries = static_cast<std::size_t>(impl_->trial.tries());
    return facts;
}

PassEffect MovingOcclusion::effect() const {
    const Facts of = facts();
    PassEffect effect{"occlusion", of.frames_on > 0};
    const auto frames = static_cast<double>(std::max<std::size_t>(of.frames, 1));
    const auto a_frame = [&](std::size_t count) {
        return static_cast<int>(std::lround(static_cast<double>(count) / frames));
    };
    effect.surface_passes = a_frame(of.drawings);
    effect.full_screen_passes = a_frame(of.pictures);
    effect.texture_bytes = of.bytes;
    effect.milliseconds = of.milliseconds / frames;
    const std::string counts = std::to_string(of.pictures) + (of.pictures == 1 ? " picture in " : " pictures in ") +
                               std::to_string(of.frames) + " frames";
    if (impl_->options.use == MovingOcclusionOptions::Use::always) {
        effect.why = "what lies behind what earlier frames showed is folded: " + counts;
        return effect;
    }
    if (of.tries == 0) {
        effect.why = "not tried yet";
        return effect;
    }
    const auto text = [](double ms) { return std::isnan(ms) ? std::string("?") : rounded(ms, 3) + " ms"; };
    effect.on = impl_->trial.is_chosen();
    effect.why = std::string(effect.on ? "it saves time" : "it does not save enough time") + ": frames took " +
                 text(of.with_ms) + " with it and " + text(of.without_ms) + " without; " + counts + ", " +
                 std::to_string(of.tries) + (of.tries == 1 ? " try" : " tries");
    return effect;
}

} // namespace unseen::session
