#include "programs.h"

#include <iterator>
#include <string>
#include <vector>

#include <unseen/vdtree/lighting.h>

#include "shaders.h"

namespace unseen::render {
namespace {

Result<Program> build_surface(const ProgramKey& key) {
    std::vector<ShaderSource> sources = {{ShaderSource::Stage::vertex, shaders::surface_vert}};
    if (key.output == Output::depth) return Program::build("depth", sources);
    std::string wrapped;
    if (key.compares || key.stippled)
        wrapped = "#define main surface_main\n#line 1\n" + std::string(shaders::surface_frag) +
                  "#undef main\n#line 1\n" + std::string(key.compares ? shaders::compare_frag : shaders::stipple_frag);
    sources.push_back({ShaderSource::Stage::fragment, wrapped.empty() ? shaders::surface_frag : wrapped});
    if (key.flat || key.wireframe) sources.push_back({ShaderSource::Stage::geometry, shaders::surface_geom});

    std::vector<std::string_view> defines;
    if (key.flat) defines.push_back("FLAT");
    if (key.wireframe) defines.push_back("WIREFRAME");
    if (key.lit) defines.push_back("LIT");
    if (key.textured) defines.push_back("TEXTURED");
    if (key.output != Output::linear) defines.push_back("DISPLAY");
    if (key.output == Output::encoded) defines.push_back("ENCODE_SRGB");
    constexpr std::string_view casting[] = {"CASTING 1", "CASTING 2", "CASTING 3", "CASTING 4"};
    static_assert(std::size(casting) == vdtree::most_shadow_lights);
    if (key.casting > 0) defines.push_back(casting[key.casting - 1]);
    if (key.mask) defines.push_back("MASK");
    if (key.share) defines.push_back("SHARE");
    return Program::build("surface", sources, defines);
}

// The key's program, built where the map has none yet.
template <class Key, class Build>
Result<const Program*> find_or_build(std::map<Key, Program>& programs, const Key& key, Build&& build) {
    auto found = programs.find(key);
    if (found == programs.end()) {
        auto built = build();
        if (!built) return built.error();
        found = programs.emplace(key, std::move(*built)).first;
    }
    return &found->second;
}

} // namespace

Result<const Program*> Programs::surface(ProgramKey key) {
    if (key.output == Output::depth) key = {.output = Output::depth}; // looks do not change where a surface is
    return find_or_build(surfaces_, key, [&] { return build_surface(key); });
}

Result<const Program*> Programs::named(std::string_view label, std::span<const ShaderSource> sources,
                                       std::span<const std::string_view> defines) {
    return find_or_build(named_, label, [&] { return Program::build(label, sources, defines); });
}

} // namespace unseen::render
