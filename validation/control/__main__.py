"""python -m validation.control: see the package."""

from validation.control.table import main

if __name__ == "__main__":
    main()
