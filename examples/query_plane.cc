// Samples a model along a plane through the centre of its region, tilted about Y, and writes the
// plane as a picture:
//   query_plane tomogram.h5 30 plane.pgm
#include <tomofield/error.h>
#include <tomofield/model.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iostream>

int main(int argc, char** argv) try {
  if (argc != 4) throw tomofield::Error("usage: query_plane MODEL TILT_DEG PICTURE.pgm");
  const tomofield::Model model(argv[1]);
  tomofield::SampleBox plane = model.region();
  plane.size[2] = 1;
  plane.euler_deg = {0, std::atof(argv[2]), 0};
  const std::vector<float> values = model.sample(plane);

  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  const float scale = *high > *low ? 255.0f / (*high - *low) : 0.0f;
  std::ofstream picture(argv[3], std::ios::binary);
  picture << "P5\n" << plane.size[0] << ' ' << plane.size[1] << "\n255\n";
  for (const float value : values) picture.put(static_cast<char>((value - *low) * scale));
  std::cout << plane.size[0] << " x " << plane.size[1] << " values from " << *low << " to " << *high
            << '\n';
} catch (const tomofield::Error& error) {
  std::cerr << error.what() << '\n';
  return 2;
}
