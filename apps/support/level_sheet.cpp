#include "level_sheet.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>

#include <unseen/session_gpu/scene_renderer.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/number_format.h>

#include "picture_columns.h"

namespace unseen::app {
namespace {

using perception::Image;
using session::LodLevel;

constexpr int cell_px = 280, samples = 64;
const glm::dvec3 towards_eye = glm::normalize(glm::dvec3(0.5, 0.3, 1));

// A square of it around the middle, in which a sphere with this outline has some room; each pixel becomes a square.
Image enlarged(const Image& image, double outline_px) {
    constexpr double room_px = 8;
    const int factor = std::max(1, static_cast<int>(cell_px / (2 * outline_px + room_px)));
    const int seen = (cell_px + factor - 1) / factor;
    const int left = (image.width - seen) / 2, top = (image.height - seen) / 2;
    Image large{cell_px, cell_px, image.channels, {}};
    for (int y = 0; y < cell_px; ++y)
        for (int x = 0; x < cell_px; ++x) {
            const int column = std::clamp(left + x / factor, 0, image.width - 1);
            const int row = std::clamp(top + y / factor, 0, image.height - 1);
            for (int c = 0; c < image.channels; ++c)
                large.values.push_back(
                    image.values[static_cast<std::size_t>((row * image.width + column) * image.channels + c)]);
        }
    return large;
}

} // namespace

Result<Image> draw_level_sheet(const session::Session& session, const render::Context& context, const session::Lod& lod,
                               const std::string& title) {
    if (lod.objects.size() != 1)
        return Error{ErrorCode::unsupported, "A sheet shows the levels of one object, and the scene has " +
                                                 std::to_string(lod.objects.size()) +
                                                 ": give --as model, or a file of that object."};
    const session::LodObject& object = lod.objects[0];
    if (object.levels.size() < 2) return invalid_argument("There is nothing for a sheet: " + object.notes.back());
    auto renderer = session::SceneRenderer::create(context, session);
    if (!renderer) return renderer.error();
    vdtree::View window;
    window.width = window.height = cell_px;
    const vdtree::View near = session.frame(towards_eye, 0.9, window);
    const vdtree::Cut full = object.cut(0);
    std::vector<PictureColumn> columns;
    for (std::size_t i = 1; i < object.levels.size(); ++i) {
        const LodLevel& level = object.levels[i];
        const vdtree::Cut cut = object.cut(i);
        const vdtree::View far = session::lod_view(lod, object.sphere, towards_eye, level.distance);
        const double outline_px = std::sqrt(level.coverage * lod.width_px * lod.height_px / std::numbers::pi);
        PictureColumn& column = columns.emplace_back();
        column.name = std::to_string(i) + ": " + grouped(level.triangles) + " triangles";
        column.verdict = "from " + rounded(level.distance, 3) + " m";
        struct Picture {
            const vdtree::Cut& cut;
            const vdtree::View& view;
            bool is_far, has_edges;
        };
        for (const Picture& wanted : {Picture{full, far, true, false},
                                      {cut, far, true, false},
                                      {cut, near, false, false},
                                      {cut, near, false, true}}) {
            render::DrawOptions options;
            options.samples = samples;
            options.background = session.background();
            options.wireframe = wanted.has_edges;
            const session::DrawnCut drawn[] = {{&wanted.cut}};
            const auto frame = renderer->draw(drawn, wanted.view, options);
            if (!frame) return frame.error();
            Image picture = session::code_image(*frame, session.observer().display);
            column.pictures.push_back(wanted.is_far ? enlarged(picture, outline_px) : std::move(picture));
        }
    }
    return compose_columns(
        title + "   full mesh and level at the level's distance, pixels enlarged; the level from near by", columns);
}

} // namespace unseen::app
