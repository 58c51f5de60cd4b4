#include <unseen/render/draw.h>

#include "surface_pass.h"

namespace unseen::render {

Result<void> draw(std::span<const Item> items, const Camera& camera, Target& target, const Clear& clear,
                  int attachment) {
    const Target::Impl& to = target.impl();
    return in_context(to.context, "Drawing", [&]() -> Result<void> {
        const auto pass = SurfacePass::prepare(items, camera, to, attachment);
        if (!pass) return pass.error();
        pass->draw(to, camera.point, clear);
        return {};
    });
}

Result<PixelBox> pixels_of(std::span<const Item> items, const vdtree::View& view) {
    if (auto valid = vdtree::validate(view); !valid) return valid.error();
    const auto projections = projections_of(items, view, {});
    if (!projections) return projections.error();
    ShownPixels shown(view);
    for (std::size_t i = 0; i < items.size(); ++i)
        shown.add((*projections)[i], items[i].cut.impl().box, glm::dvec2(0.5));
    return shown.box();
}

Result<double> near_plane(std::span<const Item> items, const vdtree::View& view) {
    if (auto valid = vdtree::validate_perspective(view, "A near plane"); !valid) return valid.error();
    const auto projections = projections_of(items, view, {});
    if (!projections) return projections.error();
    return projections->empty() ? 1.0 : projections->front().near_plane;
}

} // namespace unseen::render
