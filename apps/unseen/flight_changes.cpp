#include "flight_changes.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>
#include <unseen/session_gpu/scene_renderer.h>

namespace unseen::app {
namespace {

// Where a point is in a view's window, in pixels; nothing for what is not before the eye.
std::optional<glm::dvec2> pixel_of(const glm::dvec3& point, const vdtree::View& view) {
    const vdtree::CameraFrame frame = vdtree::camera_frame(view);
    const glm::dvec3 from_eye = point - view.eye;
    const double depth = -glm::dot(from_eye, frame.back);
    if (!(depth > 0)) return std::nullopt;
    const double focal =
        view.height * 0.5 / std::tan(perception::to_radians(perception::Degrees(view.fov_y_degrees)).value() / 2);
    return glm::dvec2(view.width * 0.5 + focal * glm::dot(from_eye, frame.right) / depth,
                      view.height * 0.5 - focal * glm::dot(from_eye, frame.up) / depth);
}

// The largest of the magnitudes within `reach` along a line of samples `step` apart.
void spread_line(const float* from, float* to, int count, std::ptrdiff_t step, int reach) {
    for (int i = 0; i < count; ++i) {
        float most = 0;
        for (int j = std::max(0, i - reach); j <= std::min(count - 1, i + reach); ++j)
            most = std::max(most, std::abs(from[j * step]));
        to[i * step] = most;
    }
}

std::vector<float> largest_near(const std::vector<float>& values, int width, int height, int reach) {
    std::vector<float> rows(values.size()), near(values.size());
    for (int y = 0; y < height; ++y) {
        const std::size_t line = static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
        spread_line(&values[line], &rows[line], width, 1, reach);
    }
    for (int x = 0; x < width; ++x)
        spread_line(&rows[static_cast<std::size_t>(x)], &near[static_cast<std::size_t>(x)], height, width, reach);
    return near;
}

std::vector<float> difference(const perception::Image& a, const perception::Image& b) {
    std::vector<float> values(a.values.size());
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = a.values[i] - b.values[i];
    return values;
}

// Budgets of triangles and time are spent on what is in sight: without that, they make another cut.
bool is_limited(const session::Request& request) {
    return request.goal.kind == session::Goal::Kind::budget || request.milliseconds;
}

} // namespace

FlightChanges::FlightChanges(const session::Session& session, Renderers renderers)
    : session_(session), renderers_(std::move(renderers)), full_cut_(session.tree()), follower_(session),
      watch_(session::judge_options(session.observer())) {
    full_cut_.unfold_all();
}

Result<FlightChanges> FlightChanges::create(const session::Session& session, const render::Context& context,
                                            std::optional<double> glide_s) {
    if (session.scene().lights && !session.scene().lights->casting().empty())
        return Error{ErrorCode::unsupported, "--changes are judged without shadows: give --no-shadows."};
    auto full = render::Renderer::create(context, session.tree());
    if (!full) return full.error();
    auto cut = render::Renderer::create(context, session.tree());
    if (!cut) return cut.error();
    FlightChanges changes(session, {std::move(*full), std::move(*cut)});
    if (glide_s)
        if (auto set = changes.follower_.set_glide(*glide_s); !set) return set.error();
    return changes;
}

// By how many pixels the picture of the scene moves at most from one view to another, by points all over its sphere.
double FlightChanges::picture_pixels(const vdtree::View& from, const vdtree::View& to) const {
    const session::WorldSphere sphere = session_.bounding_sphere();
    const double farthest = std::max(to.width, to.height) / 8.0; // a jump: there is no finding anything again
    double most = 0;
    constexpr int steps = 4;
    for (int x = -steps; x <= steps; ++x)
        for (int y = -steps; y <= steps; ++y)
            for (int z = -steps; z <= steps; ++z) {
                const glm::dvec3 offset = glm::dvec3(x, y, z) / static_cast<double>(steps);
                if (glm::length(offset) > 1) continue;
                const auto a = pixel_of(sphere.centre + sphere.radius * offset, from),
                           b = pixel_of(sphere.centre + sphere.radius * offset, to);
                if (!a || !b) continue;
                const auto is_inside = [&](const glm::dvec2& p) {
                    return p.x >= 0 && p.y >= 0 && p.x <= to.width && p.y <= to.height;
                };
                if (is_inside(*a) || is_inside(*b)) most = std::max(most, glm::length(*a - *b));
            }
    return std::min(most, farthest);
}

Result<perception::Image> FlightChanges::draw_cut(const session::Follower& follower, const vdtree::View& view,
                                                  const render::DrawOptions& options) {
    const vdtree::Similarity& placement = session_.scene().objects.front().placement;
    auto frame = follower.geomorph() ? renderers_.cut.draw(*follower.geomorph(), view, options, placement)
                                     : renderers_.cut.draw(follower.cut(), view, options, placement);
    if (!frame) return frame.error();
    return session::luminance_image(*frame, session_.observer().display);
}

Result<void> FlightChanges::before(const session::Follower& flight, const session::Request& request,
                                   const vdtree::View& view, const render::DrawOptions& options) {
    last_cut_.reset();
    if (last_error_.empty()) return {}; // the first frame
    auto drawn = draw_cut(is_limited(request) ? flight : follower_, view, options);
    if (!drawn) return drawn.error();
    last_cut_ = std::move(*drawn);
    return {};
}

Result<FrameChange> FlightChanges::after(const session::Follower& flight, const session::Request& request,
                                         const vdtree::View& view, const render::DrawOptions& options,
                                         const render::Frame& frame, double frame_s) {
    const perception::Display& display = session_.observer().display;
    const auto drawn = renderers_.full.draw(full_cut_, view, options, session_.scene().objects.front().placement);
    if (!drawn) return drawn.error();
    const perception::Image full = session::luminance_image(*drawn, display),
                            now = session::luminance_image(frame, display);
    const perception::JudgeOptions judging = session::judge_options(session_.observer());
    const auto judged =
        perception::judge_modern(session::light_image(*drawn, display), session::light_image(frame, display), judging);
    if (!judged) return judged.error();
    FrameChange result;
    result.picture = judged->max_ratio;
    const std::vector<float> error = difference(now, full);

    if (!is_limited(request)) {
        session::Request in_sight_or_not = request;
        in_sight_or_not.purpose = session::Purpose::mesh;
        follower_.let_pass(frame_s);
        if (const auto followed = follower_.follow(view, in_sight_or_not); !followed) return followed.error();
    }
    watch_.set_gaze(judging.gaze_px);
    if (last_cut_) {
        auto changed = draw_cut(is_limited(request) ? flight : follower_, view, options);
        if (!changed) return changed.error();
        const int reach = static_cast<int>(std::ceil(picture_pixels(last_view_, view)));
        const std::vector<float> last = largest_near(last_error_, now.width, now.height, reach);
        for (std::size_t i = 0; i < error.size(); ++i) {
            const float before = last_cut_->values[i], room = std::abs(error[i]) + last[i];
            changed->values[i] = before + std::clamp(changed->values[i] - before, -room, room);
        }
        auto change = watch_.next(*last_cut_, *changed, frame_s);
        if (!change) return change.error();
        result.change = *change;
    } else {
        watch_.pass(frame_s);
    }
    last_error_ = error;
    last_view_ = view;
    return result;
}

} // namespace unseen::app
