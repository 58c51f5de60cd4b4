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

Result<double> near_plane(std::span<const Item> items, const vdtree::View& view) {
    if (auto valid = vdtree::validate_perspective(view, "A near plane"); !valid) return valid.error();
    const auto projections = projections_of(items, view, {});
    if (!projections) return projections.error();
    return projections->empty() ? 1.0 : projections->front().near_plane;
}

} // namespace unseen::render
