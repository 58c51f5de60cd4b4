// Several textures in one: trees have one texture each.
#pragma once

#include <span>
#include <string>
#include <vector>

#include <unseen/vdtree/internal/texture_pyramid.h>
#include <unseen/vdtree/mesh.h>

namespace unseen::session {

// One of the textures, and the coordinates at which it is looked up.
struct AtlasPart {
    std::string name;               // for messages
    const vdtree::Texture* texture; // the caller's; must outlive the call of make_atlas()
    vdtree::UvBox used;
};

// Where a part is in the atlas: coordinates there are scale * uv + offset.
struct AtlasPlace {
    glm::dvec2 scale = glm::dvec2(0), offset = glm::dvec2(0);
};

struct Atlas {
    vdtree::Texture texture;
    std::vector<AtlasPlace> places; // by part
};

// Puts parts side by side, each as often as its coordinates repeat it, with borders that go on as the part does, so
// that filters do not mix neighbours. Fails where that is larger than a texture may be.
Result<Atlas> make_atlas(std::span<const AtlasPart> parts);

} // namespace unseen::session
