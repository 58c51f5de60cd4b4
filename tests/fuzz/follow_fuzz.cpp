// Fuzz target for cuts that follow a viewpoint: the bytes choose tree, criteria, viewpoints, options and all else that
// can be done with a cut (follow_drive.h); the cut has to stay what its definition asks for.
//
// With clang: clang++ -fsanitize=fuzzer,address,undefined ... (see tests/README.md). With other compilers define
// UNSEEN_FUZZ_STANDALONE for a main() that runs the files named on the command line.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "follow_drive.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string fault = unseen::support::FollowDrive({data, size}).run();
    if (fault.empty()) return 0;
    std::fprintf(stderr, "%s\n", fault.c_str());
    std::abort();
}

#ifdef UNSEEN_FUZZ_STANDALONE
#include <fstream>
#include <iterator>

int main(int count, char** files) {
    for (int i = 1; i < count; ++i) {
        std::ifstream stream(files[i], std::ios::binary);
        const std::string bytes{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
        LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
    }
}
#endif
