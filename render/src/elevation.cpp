// As perception's rpg99_map() computes it on the CPU in doubles, which is the reference: levels are of two floats.
#include <unseen/render/internal/elevation.h>

#include <cassert>
#include <cmath>
#include <string>
#include <utility>

#include <glm/vec4.hpp>
#include <unseen/render/target.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/judge_tables.h>

#include "gl.h"
#include "gpu_plane.h"
#include "luminance_texture.h"
#include "plane_program.h"

namespace unseen::render {
namespace {

constexpr std::size_t band_count = Rpg99Tables::band_count, level_count = Rpg99Tables::level_count;

Result<void> check(const Rpg99Tables& t) {
    assert(t.log2_csf.size() == band_count * t.log2_tvi.size());
    if (t.luminances > largest_target_side())
        return unsupported("judge: the tables are larger than this GPU's textures; map on the CPU");
    return {};
}

} // namespace

struct ElevationPasses::Impl {
    Impl(const Context& context_, glm::ivec2 size_, const Rpg99Tables& tables_)
        : context(context_), size(size_), tables(tables_) {}
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;
    ~Impl() { static_cast<void>(context.make_current()); } // for the objects, which go next

    Result<void> prepare();
    Result<void> map(const LuminanceTexture& picture, std::size_t number);

    Context context; // first, and so gone last
    glm::ivec2 size;
    Rpg99Tables tables;
    Texture2d sensitivities;
    // High, low, and, but for the first, the level before less this one.
    std::vector<GpuPlanes> levels;
    GpuPlanes rows, packed;
    std::vector<GpuPlanes> maps;
    int passes_done = 0;
    const Program *copy = nullptr, *along_rows = nullptr, *along_columns = nullptr, *elevate = nullptr,
                  *unpack = nullptr;
};

Result<void> ElevationPasses::Impl::prepare() {
    if (auto ok = check_size(size.x, size.y); !ok) return ok;
    if (auto ok = check(tables); !ok) return ok;
    PlanePrograms programs(context);
    programs.find(copy, "luminance", shaders::luminance_frag);
    programs.find(along_rows, "smooth rows", shaders::smooth_frag, {"ALONG_ROWS"});
    programs.find(along_columns, "smooth columns", shaders::smooth_frag, {"WITH_DIFFERENCE"});
    programs.find(elevate, "elevate", shaders::elevate_frag);
    programs.find(unpack, "unpack", shaders::unpack_frag);
    if (auto ok = programs.result(); !ok) return ok;
    const auto make = [&](int count, const char* label) {
        return GpuPlanes::create(size, count, PlaneFormat::full, label);
    };
    for (std::size_t i = 0; i < level_count; ++i) {
        auto level = make(i == 0 ? 2 : 3, "level of a picture");
        if (!level) return level.error();
        levels.push_back(std::move(*level));
    }
    auto made_rows = make(2, "level of a picture");
    if (!made_rows) return made_rows.error();
    rows = std::move(*made_rows);
    auto made_packed = make(1, "thresholds");
    if (!made_packed) return made_packed.error();
    packed = std::move(*made_packed);
    std::vector<float> texels = tables.log2_csf;
    texels.insert(texels.end(), tables.log2_tvi.begin(), tables.log2_tvi.end());
    sensitivities = Texture2d::create("sensitivity");
    const auto height = static_cast<GLsizei>(band_count) + 1;
    glTextureStorage2D(sensitivities.id(), 1, GL_R32F, tables.luminances, height);
    reset_pixel_stores();
    glTextureSubImage2D(sensitivities.id(), 0, 0, 0, tables.luminances, height, GL_RED, GL_FLOAT, texels.data());
    return {};
}

Result<void> ElevationPasses::Impl::map(const LuminanceTexture& picture, std::size_t number) {
    if (auto ok = check_texture(picture); !ok) return ok;
    if (picture.width != size.x || picture.height != size.y)
        return judge_error("the tables are for pictures of " + size_text(size.x, size.y) + ", not " +
                           size_text(picture.width, picture.height));
    if (maps.size() <= number) maps.resize(number + 1);
    GpuPlanes& map = maps[number];
    if (!map) {
        auto made = GpuPlanes::create(size, 1, PlaneFormat::single, "thresholds");
        if (!made) return made.error();
        map = std::move(*made);
    }
    PlanePasses passes;
    const glm::ivec2 texels = texels_of(size);
    const float zero[4] = {};
    for (const GLint buffer : {0, 1}) glClearNamedFramebufferfv(levels[0].framebuffer(), GL_COLOR, buffer, zero);
    copy->set(0, size);
    copy->set(1, static_cast<unsigned>(picture.channel));
    copy->set(2, glm::vec4(picture.scale, picture.offset, 0, 0));
    // The copy writes the first plane only; what the other one gets is not defined, so it gets none.
    glNamedFramebufferDrawBuffer(levels[0].framebuffer(), GL_COLOR_ATTACHMENT0);
    passes.draw(*copy, levels[0], texels, {picture.id});
    const GLenum both[] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
    glNamedFramebufferDrawBuffers(levels[0].framebuffer(), 2, both);
    const glm::vec4 taps(tables.kernel[0], tables.kernel[1], tables.kernel[2], 0);
    for (const Program* program : {along_rows, along_columns}) {
        program->set(0, size);
        program->set(1, taps);
    }
    for (std::size_t i = 1; i < level_count; ++i) {
        const GpuPlanes& before = levels[i - 1];
        passes.draw(*along_rows, rows, texels, {before.texture(0), before.texture(1)});
        passes.draw(*along_columns, levels[i], texels,
                    {rows.texture(0), rows.texture(1), before.texture(0), before.texture(1)});
    }
    elevate->set(0,
                 glm::vec4(tables.masking_scale, tables.masking_gain, tables.masking_power, tables.largest_elevation));
    elevate->set(1, glm::vec4(tables.first_log2, static_cast<float>(tables.nodes_an_octave),
                              static_cast<float>(tables.luminances), tables.floor));
    elevate->set(2, std::span<const float>(tables.frequency_factor));
    unsigned unit = 0;
    for (std::size_t i = 0; i < band_count; ++i) passes.bind(unit++, levels[i + 1].texture(2));
    for (std::size_t i = 0; i < band_count; ++i) passes.bind(unit++, levels[i + 2].texture(0));
    passes.bind(unit++, levels[static_cast<std::size_t>(tables.adaptation_level)].texture(0));
    passes.bind(unit++, sensitivities.id());
    passes.draw(*elevate, packed, texels, {});
    passes.draw(*unpack, map, size, {packed.texture()});
    passes_done += passes.count();
    return {};
}

ElevationPasses::ElevationPasses(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ElevationPasses::ElevationPasses(ElevationPasses&&) noexcept = default;
ElevationPasses& ElevationPasses::operator=(ElevationPasses&&) noexcept = default;
ElevationPasses::~ElevationPasses() = default;

Result<ElevationPasses> ElevationPasses::create(const Context& context, int width, int height,
                                                const Rpg99Tables& tables) {
    auto impl = std::make_unique<Impl>(context, glm::ivec2(width, height), tables);
    auto made = in_context(context, "Preparing maps of thresholds", [&] { return impl->prepare(); });
    if (!made) return made.error();
    return ElevationPasses(std::move(impl));
}

Result<void> ElevationPasses::map_thresholds(const LuminanceTexture& picture, int number) {
    if (number < 0 || number >= most_maps)
        return judge_error("maps of thresholds have the numbers 0 to " + std::to_string(most_maps - 1) + ", not " +
                           std::to_string(number));
    return in_context(impl_->context, "Mapping thresholds",
                      [&] { return impl_->map(picture, static_cast<std::size_t>(number)); });
}

Result<std::vector<float>> ElevationPasses::read_thresholds(int number) const {
    const unsigned texture = thresholds_texture(number);
    if (texture == 0) return judge_error("there is no map of thresholds yet");
    std::vector<float> values;
    auto done = in_context(impl_->context, "Reading thresholds", [&]() -> Result<void> {
        values = read_floats(texture, impl_->size);
        return {};
    });
    if (!done) return done.error();
    return values;
}

unsigned ElevationPasses::thresholds_texture(int number) const noexcept {
    const auto& maps = impl_->maps;
    if (number < 0 || static_cast<std::size_t>(number) >= maps.size()) return 0;
    const GpuPlanes& planes = maps[static_cast<std::size_t>(number)];
    return planes ? planes.texture() : 0;
}

int ElevationPasses::full_screen_passes() const noexcept { return impl_->passes_done; }

std::uint64_t ElevationPasses::texture_bytes() const noexcept {
    std::uint64_t bytes = impl_->rows.bytes() + impl_->packed.bytes();
    for (const GpuPlanes& level : impl_->levels) bytes += level.bytes();
    for (const GpuPlanes& map : impl_->maps) bytes += map.bytes();
    return bytes;
}

} // namespace unseen::render
