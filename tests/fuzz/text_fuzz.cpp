// Fuzz target for what people and other programs write down: profiles of displays, observers and lights, sensitivities,
// a calibration that goes on, studies and their answers, recorded gazes, camera paths, tables of photometers. Any bytes,
// after one that chooses the reader, must give an error with a message, or something valid. tests/README.md tells how to
// build and run it.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string_view>

#include <unseen/calibration/calibration.h>
#include <unseen/perception/gaze.h>

#include "camera_path.h"
#include "memory_file.h"

namespace {

using namespace unseen;

// Errors say something; what is read has passed `is_valid`.
template <class T, class F>
void expect(const Result<T>& read, F&& is_valid) {
    if (read ? !is_valid(*read) : read.error().message.empty()) std::abort();
}
constexpr auto anything = [](const auto&) { return true; };

void read_as(unsigned reader, const std::filesystem::path& file) {
    switch (reader) {
    case 0:
        expect(calibration::read_display(file), [](const auto& d) { return perception::validate(d).has_value(); });
        break;
    case 1: expect(calibration::read_csf(file), anything); break;
    case 2: expect(calibration::read_observer(file), anything); break;
    case 3: expect(calibration::LightRig::read(file), anything); break;
    case 4: expect(calibration::Procedure::resume(file, perception::CsfTable::standard()), anything); break;
    case 5: expect(calibration::read_sensitivities(file), anything); break;
    case 6:
        expect(calibration::read_study(file), [](const auto& study) {
            return calibration::validate(study).has_value() && !calibration::trials_of(study, "x").empty();
        });
        break;
    case 7: expect(calibration::analyse_answers(std::span(&file, 1)), anything); break;
    case 8:
        expect(perception::read_gaze_recording(file),
               [](const auto& recording) { return !recording.trace.samples().empty(); });
        break;
    case 9:
        expect(app::CameraPath::read(file.string(), {0, 1, 0}),
               [](const auto& path) { return !path.poses_from(vdtree::View()).empty(); });
        break;
    case 10: expect(calibration::read_photometer(file), anything); break;
    default: break;
    }
}
constexpr unsigned readers = 11;

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0) return 0;
    static fuzz::MemoryFile file;
    file.hold(std::string_view(reinterpret_cast<const char*>(data) + 1, size - 1));
    read_as(data[0] % readers, file.path());
    return 0;
}
