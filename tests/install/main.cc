#include <tomofield/error.h>
#include <tomofield/model.h>
#include <tomofield/version.h>
#include <iostream>
int main() try {
  std::cout << "tomofield " << tomofield::library_version() << '\n';
  return static_cast<int>(tomofield::Model("absent.h5").sample({}).size());
} catch (const tomofield::Error& error) {
  std::cout << "caught " << error.what() << '\n';
}
