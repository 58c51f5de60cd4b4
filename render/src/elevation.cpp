// As perception's rpg99_map() computes it on the CPU in doubles, which is the reference: levels are of two floats.
#include <unseen/render/internal/elevation.h>

#include <cmath>

#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/judge_tables.h>

#include "gpu_plane.h"
#include "shaders.h"

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
        : context(context_), size(size_), tables(tables_), guard(context_) {}

    Result<void> prepare() {
        if (auto ok = check_size(size.x, size.y); !ok) return ok;
        if (auto ok = check(tables); !ok) return ok;
        PlanePrograms programs(context);
        programs.find(copy, "luminance", shaders::luminance_frag);
        programs.find(along_rows, "smooth rows", shaders::smooth_frag, {"ALONG_ROWS"});
        programs.find(along_columns, "smooth columns", shaders::smooth_frag, {"WITH_DIFFERENCE"});
        programs.find(elevate, "elevate", shaders::elevate_frag);
        programs.find(unpack, "unpack", shaders::unpack_frag);
        if (auto ok = programs.result(); !ok) return ok;
        const auto need = [&](GpuPlanes& planes, int count, const char* label) {
            return planes.need(size, count, PlaneFormat::full, label);
        };
        for (GpuPlanes& level : levels)
            if (auto ok = need(level, &level == levels.data() ? 2 : 3, "level of a picture"); !ok) return ok;
        if (auto ok = need(rows, 2, "level of a picture"); !ok) return ok;
        if (auto ok = need(packed, 1, "thresholds"); !ok) return ok;
        std::vector<float> texels = tables.log2_csf;
        texels.insert(texels.end(), tables.log2_tvi.begin(), tables.log2_tvi.end());
        sensitivities = Texture2d::create("sensitivity");
        const auto height = static_cast<GLsizei>(band_count) + 1;
        glTextureStorage2D(sensitivities.id(), 1, GL_R32F, tables.luminances, height);
        reset_pixel_stores();
        glTextureSubImage2D(sensitivities.id(), 0, 0, 0, tables.luminances, height, GL_RED, GL_FLOAT, texels.data());
        return {};
    }

    Result<void> map(const LuminanceTexture& picture, int number) {
        if (auto ok = check_picture(picture, size); !ok) return ok;
        const auto map = maps.need(number, size);
        if (!map) return map.error();
        PlanePasses passes(context.impl().programs);
        const glm::ivec2 texels = texels_of(size);
        const float zero[4] = {};
        for (const GLint buffer : {0, 1}) glClearNamedFramebufferfv(levels[0].framebuffer(), GL_COLOR, buffer, zero);
        set_picture(*copy, picture);
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
        elevate->set(
            0, glm::vec4(tables.masking_scale, tables.masking_gain, tables.masking_power, tables.largest_elevation));
        elevate->set(1, glm::vec4(tables.first_log2, static_cast<float>(tables.nodes_an_octave),
                                  static_cast<float>(tables.luminances), tables.floor));
        elevate->set(2, std::span<const float>(tables.frequency_factor));
        unsigned unit = 0;
        for (std::size_t i = 0; i < band_count; ++i) passes.bind(unit++, levels[i + 1].texture(2));
        for (std::size_t i = 0; i < band_count; ++i) passes.bind(unit++, levels[i + 2].texture(0));
        passes.bind(unit++, levels[static_cast<std::size_t>(tables.adaptation_level)].texture(0));
        passes.bind(unit++, sensitivities.id());
        passes.draw(*elevate, packed, texels, {});
        passes.draw(*unpack, **map, size, {packed.texture()});
        passes_done += passes.count();
        return {};
    }

    Context context; // first, and so gone last
    glm::ivec2 size;
    Rpg99Tables tables;
    Texture2d sensitivities;
    // High, low, and, but for the first, the level before less this one.
    std::array<GpuPlanes, level_count> levels;
    GpuPlanes rows, packed;
    ThresholdMaps maps;
    int passes_done = 0;
    const Program *copy = nullptr, *along_rows = nullptr, *along_columns = nullptr, *elevate = nullptr,
                  *unpack = nullptr;
    ContextGuard guard;
};

Result<ElevationPasses> ElevationPasses::create(const Context& context, int width, int height,
                                                const Rpg99Tables& tables) {
    auto impl = std::make_unique<Impl>(context, glm::ivec2(width, height), tables);
    auto made = in_context(context, "Preparing maps of thresholds", [&] { return impl->prepare(); });
    if (!made) return made.error();
    return ElevationPasses(std::move(impl));
}

Result<void> ElevationPasses::map_thresholds(const LuminanceTexture& picture, int number) {
    if (auto ok = ThresholdMaps::check(number); !ok) return ok;
    return in_context(impl_->context, "Mapping thresholds", [&] { return impl_->map(picture, number); });
}

Result<std::vector<float>> ElevationPasses::read_thresholds(int number) const {
    return impl_->maps.read(impl_->context, number, impl_->size);
}

unsigned ElevationPasses::thresholds_texture(int number) const noexcept { return impl_->maps.texture(number); }
int ElevationPasses::full_screen_passes() const noexcept { return impl_->passes_done; }

std::uint64_t ElevationPasses::texture_bytes() const noexcept {
    std::uint64_t bytes = impl_->rows.bytes() + impl_->packed.bytes() + impl_->maps.bytes();
    for (const GpuPlanes& level : impl_->levels) bytes += level.bytes();
    return bytes;
}

} // namespace unseen::render
